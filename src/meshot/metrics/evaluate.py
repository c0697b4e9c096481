"""The ruler: how close a predicted surface is to its target."""

from typing import NamedTuple

import numpy as np

from meshot.errors import require_positive_integer
from meshot.mesh.intersection import self_intersecting_faces
from meshot.mesh.mesh import Mesh
from meshot.mesh.topology import euler_number
from meshot.metrics.evaluation import Evaluation, Metric
from meshot.metrics.surface import (
    Surface,
    SurfaceSample,
    average_surface_distance,
    hausdorff_distance,
    normal_agreement,
)
from meshot.metrics.transport import earth_movers_distance, sliced_distance

N_DIRECTIONS = 200


class _Row(NamedTuple):
    name: str
    unit: str
    definition: str


_ROWS = {
    "emd": _Row(
        "earth mover's distance",
        "mm",
        "Exact W2, root taken: the root of the least mean squared Euclidean distance over all pairings of "
        "{n_emd_points} points of one surface with as many of the other, drawn uniformly by area; no regularisation.",
    ),
    "swd": _Row(
        "sliced Wasserstein distance",
        "mm",
        "SW2, root taken: the root of the mean over {n_directions} even directions of the squared W2 between the "
        "projections of {n_points} points of each surface, drawn uniformly by area.",
    ),
    "assd": _Row(
        "average symmetric surface distance",
        "mm",
        "The mean distance from {n_points} points of each surface to the nearest point on the faces of the other, "
        "averaged over the two sides.",
    ),
    "hausdorff": _Row(
        "Hausdorff distance at 90 %",
        "mm",
        "The 90 % quantile of the distances from {n_points} points of one surface to the faces of the other; the "
        "larger of the two sides.",
    ),
    "normals": _Row(
        "Chamfer normals, absolute",
        "",
        "The mean absolute cosine between the normal at {n_points} points of each surface and the normal of the "
        "nearest face of the other, averaged over the two sides; 1 is best.",
    ),
    "signed_normals": _Row(
        "Chamfer normals, signed",
        "",
        "The same without the absolute value: -1 for a surface turned inside out.",
    ),
    "intersecting_faces": _Row(
        "self-intersecting faces",
        "faces",
        "Faces of the predicted mesh that meet another of its faces beyond a shared edge or corner, once each; the "
        "floor is the target's own count.",
    ),
    "intersecting_share": _Row(
        "self-intersecting share",
        "%",
        "Self-intersecting faces in per cent of all faces of the predicted mesh; the floor is the target's own.",
    ),
    "euler_number": _Row(
        "Euler number",
        "",
        "Vertices - edges + faces of the predicted mesh, 2 for a sphere; the floor is the target's own.",
    ),
}


def evaluate(
    predicted: Mesh, target: Mesh, n_points: int = 100_000, seed: int = 0, n_emd_points: int = 5_000
) -> Evaluation:
    """All metrics between a predicted and a target surface, each with its unit, definition and same-surface floor.

    The floor is what two independent samples of the target score against each other, with the same numbers of points
    and the same seed: a perfect prediction would do no better.

    Parameters
    ----------
    predicted, target : Mesh
        In the same space, in mm.
    n_points : int
        Drawn on each surface for everything but the earth mover's distance.
    seed : int
        Of the points. The same surfaces and the same seed give the same numbers.
    n_emd_points : int
        For the earth mover's distance, at most ``n_points``: the first of the same points.

    Raises
    ------
    ValueError
        If a count or the seed does not fit, or a surface has no area.

    Notes
    -----
    300 000 faces, 100 000 points, two cores: seconds for everything but the earth mover's distance, which takes about
    8 s for 5 000 points and as long again for its floor.
    """
    require_positive_integer(n_points, "n_points")
    require_positive_integer(n_emd_points, "n_emd_points")
    if n_emd_points > n_points:
        raise ValueError(f"n_emd_points is {n_emd_points}, above n_points = {n_points}; lower it, or draw more points")
    surfaces = Surface(predicted), Surface(target)
    streams = np.random.SeedSequence(seed).spawn(2)
    of_predicted, of_target, of_target_again = (
        surface.sample(n_points, np.random.default_rng(stream))
        for surface, stream in zip((*surfaces, surfaces[1]), (*streams, streams[0]), strict=True)
    )
    values = _compare(*surfaces, of_predicted, of_target, n_emd_points) | _defects(predicted)
    floors = _compare(surfaces[1], surfaces[1], of_target_again, of_target, n_emd_points) | _defects(target)
    counts = {"n_points": n_points, "n_emd_points": n_emd_points, "n_directions": N_DIRECTIONS}
    return Evaluation(
        **{
            key: Metric(row.name, values[key], row.unit, row.definition.format(**counts), floors[key])
            for key, row in _ROWS.items()
        }
    )


def _compare(
    predicted: Surface, target: Surface, sample: SurfaceSample, of_target: SurfaceSample, n_emd_points: int
) -> dict[str, float]:
    there, back = target.offsets(sample), predicted.offsets(of_target)
    return {
        "emd": earth_movers_distance(sample.points[:n_emd_points], of_target.points[:n_emd_points]),
        "swd": sliced_distance(sample.points, of_target.points, N_DIRECTIONS),
        "assd": average_surface_distance(there, back),
        "hausdorff": hausdorff_distance(there, back),
        "normals": normal_agreement(there, back),
        "signed_normals": normal_agreement(there, back, signed=True),
    }


def _defects(mesh: Mesh) -> dict[str, float]:
    n_crossing = len(self_intersecting_faces(mesh))
    share = 100 * n_crossing / len(mesh.faces)
    return {"intersecting_faces": n_crossing, "intersecting_share": share, "euler_number": euler_number(mesh)}
