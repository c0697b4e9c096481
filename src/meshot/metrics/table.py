"""Evaluation of a predicted surface against a target, with all metrics."""

import numpy as np

from meshot.errors import require_positive_integer
from meshot.mesh import Mesh
from meshot.mesh.geometry import face_areas, signed_volume
from meshot.mesh.topology import euler_number, self_intersecting_faces
from meshot.metrics.definitions import BLURRED_EMD, ROWS
from meshot.metrics.distances import (
    Surface,
    SurfaceSample,
    average_surface_distance,
    hausdorff_distance,
    normal_agreement,
)
from meshot.metrics.evaluation import Evaluation, Metric
from meshot.metrics.input_checks import require_same_space, warn_of_defects
from meshot.metrics.transport import earth_movers_distance, sinkhorn_distance, sliced_distance
from meshot.metrics.triangles import edge_length_variation, face_area_variation, smallest_angles
from meshot.types import Array

N_DIRECTIONS = 200


def evaluate(
    predicted: Mesh,
    target: Mesh,
    n_points: int = 100_000,
    seed: int = 0,
    n_emd_points: int = 5_000,
    emd_blur: float | None = None,
    floors: bool = True,
) -> Evaluation:
    """Compute all metrics between a predicted and a target surface, each with its unit, definition and floor.

    The floor of a metric is its value for two independent samples of the target, with the same numbers of points and
    the same seed. It is the value to expect from a perfect prediction.

    Parameters
    ----------
    predicted, target : Mesh
        In the same space, in mm.
    n_points : int
        Number of points drawn on each surface, for all metrics except the earth mover's distance.
    seed : int
        Seed of the points. The same surfaces and the same seed give the same values.
    n_emd_points : int
        Number of points for the earth mover's distance, at most ``n_points``: the first ones of the same sample.
    emd_blur : float, optional
        If given, the earth mover's distance is computed by Sinkhorn's algorithm with this blur, in mm, see
        ``meshot.metrics.transport.sinkhorn_distance``. By default it is exact.
    floors : bool
        Whether to compute the floors. They depend on the target only. If many surfaces are compared with one target,
        one evaluation with floors is enough. The others then take about half the time.

    Raises
    ------
    ValueError
        If a count, the seed or the blur is out of range, a vertex is NaN, a surface has zero area, the surfaces do not
        overlap, or one is more than ten times as large as the other (for example metres and millimetres).

    Warns
    -----
    UserWarning
        If the bounding boxes share less than half of the smaller one, or one is twice as large as the other; if a mesh
        is open, non-manifold, not consistently oriented, or inside out. In the latter case the distances are valid, but
        volume, Euler number or signed normals are not.

    Notes
    -----
    With 300 000 faces, 100 000 points and two cores, all metrics but the earth mover's distance take seconds. The earth
    mover's distance takes about 8 s for 5 000 points, and the same time again for its floor.

    Examples
    --------
    >>> import meshot
    >>> from meshot.mesh.shapes import icosphere
    >>> found = meshot.evaluate(icosphere(2, 11.0), icosphere(2, 10.0), n_points=500, n_emd_points=100)
    >>> type(found).__name__
    'Evaluation'
    """
    require_positive_integer(n_points, "n_points")
    require_positive_integer(n_emd_points, "n_emd_points")
    if n_emd_points > n_points:
        raise ValueError(f"n_emd_points is {n_emd_points}, above n_points = {n_points}; lower it, or draw more points")
    surfaces = Surface(predicted), Surface(target)
    require_same_space(*surfaces)
    for mesh, name in ((predicted, "predicted"), (target, "target")):
        warn_of_defects(mesh, name, float(signed_volume(mesh)))
    streams = np.random.SeedSequence(seed).spawn(2)
    of_target = surfaces[1].sample(n_points, np.random.default_rng(streams[1]))

    def numbers_of(surface: Surface, mesh: Mesh) -> dict[str, float]:
        sample = surface.sample(n_points, np.random.default_rng(streams[0]))
        emd = _emd(sample.points[:n_emd_points], of_target.points[:n_emd_points], emd_blur)
        return _compare(surface, surfaces[1], sample, of_target) | mesh_properties(mesh) | {"emd": emd}

    values = numbers_of(surfaces[0], predicted)
    of_floors = numbers_of(surfaces[1], target) if floors else dict.fromkeys(values)
    definitions = {key: row.definition for key, row in ROWS.items()} | ({"emd": BLURRED_EMD} if emd_blur else {})
    settings = {
        "n_points": n_points,
        "n_emd_points": n_emd_points,
        "n_directions": N_DIRECTIONS,
        "emd_blur": emd_blur,
    }
    return Evaluation(
        **{
            key: Metric(row.name, values[key], row.unit, definitions[key].format(**settings), of_floors[key])
            for key, row in ROWS.items()
        }
    )


def _emd(points: Array, others: Array, blur: float | None) -> float:
    if blur is None:
        return earth_movers_distance(points, others)
    return sinkhorn_distance(points, others, blur)


def _compare(predicted: Surface, target: Surface, sample: SurfaceSample, of_target: SurfaceSample) -> dict[str, float]:
    there, back = target.offsets(sample), predicted.offsets(of_target)
    return {
        "swd": sliced_distance(sample.points, of_target.points, N_DIRECTIONS),
        "assd": average_surface_distance(there, back),
        "hausdorff": hausdorff_distance(there, back),
        "normals": normal_agreement(there, back),
        "signed_normals": normal_agreement(there, back, signed=True),
    }


def mesh_properties(mesh: Mesh) -> dict[str, float]:
    """The metrics of :func:`meshot.evaluate` that depend on one mesh only, by name, in units of the vertices."""
    n_crossing = len(self_intersecting_faces(mesh))
    return {
        "intersecting_faces": n_crossing,
        "intersecting_share": 100 * n_crossing / len(mesh.faces),
        "euler_number": euler_number(mesh),
        "area": float(face_areas(mesh).sum()),
        "volume": float(signed_volume(mesh)),
        "edge_variation": edge_length_variation(mesh),
        "area_variation": face_area_variation(mesh),
        "smallest_angle": float(smallest_angles(mesh).mean()),
    }
