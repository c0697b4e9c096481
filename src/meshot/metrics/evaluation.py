"""The result of an evaluation: values with units, definitions and floors."""

import dataclasses
import warnings
from typing import NamedTuple

import numpy as np

from meshot.errors import require_positive_integer
from meshot.mesh import (
    Mesh,
    boundary_edges,
    edge_lengths,
    euler_number,
    face_areas,
    face_corners,
    is_consistently_oriented,
    nonmanifold_edges,
    self_intersecting_faces,
    signed_volume,
)
from meshot.metrics.distances import (
    Surface,
    average_surface_distance,
    earth_movers_distance,
    hausdorff_distance,
    normal_agreement,
    sinkhorn_distance,
    sliced_distance,
)
from meshot.types import Array, Float


@dataclasses.dataclass(frozen=True)
class Metric:
    """One metric of an evaluation.

    Parameters
    ----------
    name : str
    value : float
    unit : str
        "mm", "%", or what is counted; empty for a dimensionless number.
    definition : str
        An exact definition in one sentence.
    floor : float or None
        The value for two independent samples of the target of the same size. A perfect prediction would have a similar
        value. None if floors were not computed.
    """

    name: str
    value: float
    unit: str
    definition: str
    floor: float | None


@dataclasses.dataclass(frozen=True)
class Evaluation:
    """All metrics between a surface and a target surface. ``print`` shows a table; see also ``definitions``.

    Lengths are in the units of the vertices, assumed to be mm.
    """

    emd: Metric
    swd: Metric
    assd: Metric
    hausdorff: Metric
    normals: Metric
    signed_normals: Metric
    intersecting_faces: Metric
    intersecting_share: Metric
    euler_number: Metric
    area: Metric
    volume: Metric
    edge_variation: Metric
    area_variation: Metric
    smallest_angle: Metric

    def metrics(self) -> list[Metric]:
        """All metrics, in the order in which they are printed."""
        return [getattr(self, field.name) for field in dataclasses.fields(self)]

    def as_dict(self) -> dict[str, dict[str, float | str | None]]:
        """Everything as plain numbers and strings, for JSON."""
        return {name: dataclasses.asdict(getattr(self, name)) for name in self.__dataclass_fields__}

    def definitions(self) -> str:
        """The name and the definition of every metric, one line each."""
        width = max(len(metric.name) for metric in self.metrics())
        return "\n".join(f"{metric.name.ljust(width)}  {metric.definition}" for metric in self.metrics())

    def __repr__(self) -> str:
        rows = [
            (m.name, f"{m.value:.4g}", m.unit, "–" if m.floor is None else f"{m.floor:.4g}") for m in self.metrics()
        ]
        head = ("metric", "value", "unit", "floor")
        name, value, unit, floor = (max(map(len, column)) for column in zip(head, *rows, strict=True))
        return "\n".join(
            f"{n.ljust(name)}  {v.rjust(value)}  {u.ljust(unit)}  {f.rjust(floor)}".rstrip()
            for n, v, u, f in [head, *rows]
        )


# Name, unit and exact definition of every metric.


class Row(NamedTuple):
    """Name, unit and definition of a metric."""

    name: str
    unit: str
    definition: str


ROWS = {
    "emd": Row(
        "earth mover's distance",
        "mm",
        "Exact W2 (p = 2, root taken): the root of the least mean squared Euclidean distance over all pairings of "
        "{n_emd_points} points of one surface with as many of the other, drawn uniformly by area; no blur, hence "
        "nothing to debias.",
    ),
    "swd": Row(
        "sliced Wasserstein distance",
        "mm",
        "SW2 (p = 2, root taken): the root of the mean over {n_directions} even directions of the squared W2 between "
        "the projections of {n_points} points of each surface, drawn uniformly by area.",
    ),
    "assd": Row(
        "average symmetric surface distance",
        "mm",
        "The mean distance from {n_points} points of each surface to the nearest point on the faces of the other "
        "(point to face, not to a sampled point or a vertex), averaged over the two sides.",
    ),
    "hausdorff": Row(
        "Hausdorff distance at 90 %",
        "mm",
        "The 90 % quantile of the distances from {n_points} points of one surface to the faces of the other; the "
        "larger of the two sides, as DeepCSR and CortexODE report it (the two are not pooled).",
    ),
    "normals": Row(
        "Chamfer normals, absolute",
        "",
        "The mean absolute cosine between the normal at {n_points} points of each surface and the normal of the "
        "nearest face of the other, averaged over the two sides; normals of faces, not interpolated; 1 is best.",
    ),
    "signed_normals": Row(
        "Chamfer normals, signed",
        "",
        "The same without the absolute value: -1 for a surface turned inside out.",
    ),
    "intersecting_faces": Row(
        "self-intersecting faces",
        "faces",
        "Faces of the predicted mesh that meet another of its faces beyond a shared edge or corner, once each; the "
        "floor is the target's own count.",
    ),
    "intersecting_share": Row(
        "self-intersecting share",
        "%",
        "Self-intersecting faces in per cent of all faces of the predicted mesh; the floor is the target's own.",
    ),
    "euler_number": Row(
        "Euler number",
        "",
        "Vertices - edges + faces of the predicted mesh, 2 for a sphere; the floor is the target's own.",
    ),
    "area": Row("area", "mm²", "Total area of the faces of the predicted mesh; the floor is the target's own."),
    "volume": Row(
        "volume",
        "mm³",
        "Volume that the predicted mesh encloses, positive with outward normals; the floor is the target's own.",
    ),
    "edge_variation": Row(
        "edge length variation",
        "",
        "Standard deviation over mean of the edge lengths of the predicted mesh; the floor is the target's own.",
    ),
    "area_variation": Row(
        "face area variation",
        "",
        "Standard deviation over mean of the face areas of the predicted mesh; the floor is the target's own.",
    ),
    "smallest_angle": Row(
        "smallest angle",
        "degrees",
        "The smallest angle of each face of the predicted mesh, averaged over its faces (60 if all are equilateral); "
        "the floor is the target's own.",
    ),
}
#: The definition of the EMD if it is computed by Sinkhorn's algorithm.
BLURRED_EMD = (
    "Root of the debiased Sinkhorn divergence with squared Euclidean cost (p = 2; twice what GeomLoss returns) and a "
    "blur of {emd_blur} mm between {n_emd_points} points of each surface, drawn uniformly by area; scaling 0.95."
)


# Evaluation of a predicted surface against a target, with all metrics.

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
        ``meshot.metrics.distances.sinkhorn_distance``. By default it is exact.
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
        points = sample.points[:n_emd_points], of_target.points[:n_emd_points]
        there, back = surfaces[1].offsets(sample), surface.offsets(of_target)
        return mesh_properties(mesh) | {
            "emd": earth_movers_distance(*points) if emd_blur is None else sinkhorn_distance(*points, emd_blur),
            "swd": sliced_distance(sample.points, of_target.points, N_DIRECTIONS),
            "assd": average_surface_distance(there, back),
            "hausdorff": hausdorff_distance(there, back),
            "normals": normal_agreement(there, back),
            "signed_normals": normal_agreement(there, back, signed=True),
        }

    values = numbers_of(surfaces[0], predicted)
    of_floors = numbers_of(surfaces[1], target) if floors else dict.fromkeys(values)
    definitions = {key: row.definition for key, row in ROWS.items()} | ({"emd": BLURRED_EMD} if emd_blur else {})
    settings = {"n_points": n_points, "n_emd_points": n_emd_points, "n_directions": N_DIRECTIONS, "emd_blur": emd_blur}
    return Evaluation(
        **{
            key: Metric(
                row.name,
                values[key],
                row.unit,
                definitions[key].format(**settings),
                of_floors[key],
            )
            for key, row in ROWS.items()
        }
    )


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


# Regularity of the triangles of a mesh.


def edge_length_variation(mesh: Mesh) -> float:
    """The coefficient of variation of the edge lengths: standard deviation over mean; 0 if all are equal."""
    return _variation(edge_lengths(mesh).detach().double().cpu().numpy())


def face_area_variation(mesh: Mesh) -> float:
    """The coefficient of variation of the face areas: standard deviation over mean; 0 if all are equal."""
    return _variation(face_areas(mesh).detach().double().cpu().numpy())


def smallest_angles(mesh: Mesh) -> Float[Array, " F"]:
    """The smallest angle of every face, in degrees: at most 60; 0 for a face without area."""
    corners = face_corners(mesh).detach().double().cpu().numpy()
    sides = np.roll(corners, -1, axis=1) - corners
    doubled_areas = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    dots = -np.einsum("fik,fik->fi", sides, np.roll(sides, 1, axis=1))
    return np.degrees(np.arctan2(doubled_areas[:, None], dots).min(axis=1))


def _variation(sizes: Float[Array, " n"]) -> float:
    mean = float(sizes.mean())
    return float(sizes.std()) / mean if mean > 0 else 0.0


# Checks of the meshes that are compared, with errors and warnings.

#: Ratios of the diagonals of two bounding boxes: above the first a warning is issued, above the second an error.
UNLIKE, ANOTHER_UNIT = 2, 10


def require_same_space(predicted: Surface, target: Surface) -> None:
    """Check that two surfaces overlap and have similar sizes. Otherwise the metrics would be meaningless."""
    boxes = [(s.vertices.min(axis=0), s.vertices.max(axis=0)) for s in (predicted, target)]
    sizes = [float(np.linalg.norm(high - low)) for low, high in boxes]
    boxes = [(low - 0.05 * max(sizes), high + 0.05 * max(sizes)) for low, high in boxes]
    shared = np.minimum(boxes[0][1], boxes[1][1]) - np.maximum(boxes[0][0], boxes[1][0])
    where = " and ".join(f"{low.round(1).tolist()} to {high.round(1).tolist()}" for low, high in boxes)
    remedy = "are both in scanner RAS, in mm, and of the same hemisphere?"
    if (shared <= 0).any():
        raise ValueError(f"the surfaces do not overlap: they fill the boxes {where}; {remedy}")
    extents = f"the surfaces extend over {sizes[0]:.4g} and {sizes[1]:.4g}; {remedy}"
    if max(sizes) >= ANOTHER_UNIT * min(sizes):
        raise ValueError(extents)
    share = np.prod(shared) / min(np.prod(high - low) for low, high in boxes)
    if share < 0.5:
        warnings.warn(f"the boxes {where} around the surfaces share {share:.0%} of the smaller; {remedy}", stacklevel=3)
    elif max(sizes) >= UNLIKE * min(sizes):
        warnings.warn(extents, stacklevel=3)


def warn_of_defects(mesh: Mesh, name: str, volume: float) -> None:
    """Warn if a mesh is not a closed surface with outward normals, and say which metrics are affected."""
    n_open, n_many = len(boundary_edges(mesh)), len(nonmanifold_edges(mesh))
    oriented = is_consistently_oriented(mesh)
    found = []
    if n_open:
        found.append(f"is open ({n_open} boundary edges), so that it encloses no volume")
    if n_many:
        found.append(f"has {n_many} edges of more than two faces, so that its Euler number is not that of a surface")
    if not n_many and not oriented:
        found.append("has neighbouring faces that look to opposite sides, which spoils volume and signed normals")
    elif not n_open and not n_many and volume < 0:
        found.append("is inside out (negative volume): turn its faces round with mesh.faces.flip(1)")
    if found:
        warnings.warn(f"the {name} mesh {'; it '.join(found)}; distances are valid nevertheless", stacklevel=3)
