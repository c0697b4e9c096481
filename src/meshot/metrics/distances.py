"""Distances and normal angles between points of one surface and the faces of another."""

import dataclasses
import math
import warnings

import igl
import numpy as np
import torch
from scipy.spatial.distance import cdist

from meshot.errors import require_finite, require_positive, require_positive_integer
from meshot.mesh import Mesh, face_normals, sample_locations
from meshot.rng import Generator
from meshot.types import Array, Float, Int


@dataclasses.dataclass(frozen=True, eq=False)
class SurfaceSample:
    """Random points on a surface, uniform by area, with the unit normals of their faces."""

    points: Float[Array, "n 3"]
    normals: Float[Array, "n 3"]


@dataclasses.dataclass(frozen=True, eq=False)
class Offsets:
    """Distances from points of one surface to the faces of another, and cosines between the normals there."""

    distances: Float[Array, " n"]
    cosines: Float[Array, " n"]


class Surface:
    """A mesh in double precision with a search tree of its faces, for nearest-point queries.

    Raises
    ------
    ValueError
        If a vertex is NaN or infinite (``with_vertices`` does not check this).
    """

    def __init__(self, mesh: Mesh):
        require_finite(mesh.vertices, "vertices")
        self.mesh = mesh.with_vertices(mesh.vertices.detach()).to("cpu", torch.float64)
        self.vertices = np.ascontiguousarray(self.mesh.vertices.numpy())
        self.faces = np.ascontiguousarray(self.mesh.faces.numpy())
        self.normals = face_normals(self.mesh).numpy()
        self.tree = igl.AABB()
        self.tree.init(self.vertices, self.faces)

    def sample(self, n_points: int, generator: Generator) -> SurfaceSample:
        """Independent random points, uniform by area."""
        require_positive_integer(n_points, "n_points")
        faces, barycentric = (x.numpy() for x in sample_locations(self.mesh, n_points, generator))
        corners = self.vertices[self.faces[faces]]
        return SurfaceSample(np.einsum("nc,nck->nk", barycentric, corners), self.normals[faces])

    def offsets(self, sample: SurfaceSample) -> Offsets:
        """Distances from the points of another surface to this surface, and cosines between the normals there."""
        squared, faces, _ = self.tree.squared_distance(self.vertices, self.faces, sample.points)
        # For a point on the surface itself, rounding can give a slightly negative square.
        return Offsets(np.sqrt(np.maximum(squared, 0)), (self.normals[faces] * sample.normals).sum(axis=1))

    def nearest_faces(self, points: Float[Array, "n 3"]) -> Int[Array, " n"]:
        """The face that is nearest to each point."""
        return self.tree.squared_distance(self.vertices, self.faces, np.ascontiguousarray(points))[1].astype(np.int64)

    def carry(self, points: Float[Array, "n 3"], mesh: Mesh) -> Float[Array, "n 3"]:
        """The places on a mesh with the same faces that correspond to the nearest points of this surface."""
        _, faces, nearest = self.tree.squared_distance(self.vertices, self.faces, np.ascontiguousarray(points))
        corners = np.ascontiguousarray(self.vertices[self.faces[faces]].transpose(1, 0, 2))
        shares = igl.barycentric_coordinates(np.ascontiguousarray(nearest), *corners)
        return np.einsum("nc,nck->nk", shares, mesh.vertices.detach().double().numpy()[self.faces[faces]])

    def signed_distances(self, points: Float[Array, "n 3"]) -> Float[Array, " n"]:
        """Distances from points to this surface, negative inside. It must be closed, with outward normals."""
        points = np.ascontiguousarray(points, dtype=np.float64)
        signs = igl.SIGNED_DISTANCE_TYPE_PSEUDONORMAL
        return igl.signed_distance(points, self.vertices, self.faces, sign_type=signs)[0]


def offsets_between(
    first: Surface, second: Surface, n_points: int, generators: tuple[Generator, Generator] = (0, 1)
) -> tuple[Offsets, Offsets]:
    """Distances and normal cosines from ``n_points`` random points of each surface to the other surface."""
    there, back = (each.sample(n_points, draw) for each, draw in zip((first, second), generators, strict=True))
    return second.offsets(there), first.offsets(back)


def average_surface_distance(there: Offsets, back: Offsets) -> float:
    """ASSD, the average symmetric surface distance: the mean of the two mean distances."""
    return float(there.distances.mean() + back.distances.mean()) / 2


def hausdorff_distance(there: Offsets, back: Offsets, quantile: float = 0.9) -> float:
    """The larger of the two quantiles of the distances. With ``quantile`` 1, the Hausdorff distance of the samples.

    Raises
    ------
    ValueError
        If the quantile is not in (0, 1].
    """
    if not 0 < quantile <= 1:
        raise ValueError(f"quantile is {quantile!r}; a number in (0, 1] is needed, such as 0.9")
    return float(max(np.quantile(there.distances, quantile), np.quantile(back.distances, quantile)))


def normal_agreement(there: Offsets, back: Offsets, signed: bool = False) -> float:
    """Chamfer normals: the mean of the two mean cosines between normals, in absolute value unless ``signed``."""
    cosines = [x.cosines if signed else np.abs(x.cosines) for x in (there, back)]
    return float(cosines[0].mean() + cosines[1].mean()) / 2


def vertex_distances(mesh: Mesh, target: Mesh) -> Float[Array, " V"]:
    """The distance of every vertex to the nearest point on the faces of another surface, in units of the vertices."""
    points = mesh.vertices.detach().double().cpu().numpy()
    return Surface(target).offsets(SurfaceSample(points, np.zeros_like(points))).distances


# Transport distances between point sets of equal size, in NumPy and POT. They share no code with the losses.


def earth_movers_distance(points: Float[Array, "n 3"], others: Float[Array, "n 3"]) -> float:
    """EMD: W₂, the root of the smallest mean squared distance over all pairings, exactly, in the units of the points.

    Raises
    ------
    ValueError
        If the numbers of points differ, or the solver does not converge.

    Notes
    -----
    POT's network simplex: about 1 s for 2 000 points, 8 s for 5 000, half a minute for 10 000; O(n²) memory.
    """
    _require_equal_counts(points, others)
    return exact_transport(points, others)


def exact_transport(points: Float[Array, "n d"], others: Float[Array, "m d"]) -> float:
    """W₂ between two point sets of equal masses, exactly, as a length in the units of the points.

    Raises
    ------
    ValueError
        If the solver does not converge.

    Notes
    -----
    The tolerance of the solver is absolute. The points are therefore first divided by their largest coordinate.
    """
    centre = points[0].copy()
    points, others = points - centre, others - centre
    unit = max(float(np.abs(points).max()), float(np.abs(others).max())) or 1.0
    cost = cdist(points / unit, others / unit, "sqeuclidean")  # from differences: no cancellation
    masses = [np.full(len(side), 1 / len(side)) for side in (points, others)]
    import ot  # here: it takes seconds, for which nobody waits who calls something else

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        squared = ot.emd2(*masses, cost, numItermax=max(10_000_000, 100 * cost.size))
    if caught:
        raise ValueError(f"the transport solver did not finish ({caught[0].message}): use fewer points")
    return unit * math.sqrt(max(0.0, float(squared)))


def sinkhorn_distance(points: Float[Array, "n 3"], others: Float[Array, "n 3"], blur: float) -> float:
    """EMD by regularised transport: the root of the debiased Sinkhorn divergence with squared distances as cost.

    It is computed by GeomLoss, whose value at p = 2 is half the squared cost and is doubled here. The temperature is
    annealed by a factor of 0.95² per step. The iteration stops before convergence, so the value is below W₂: by 3 % for
    two samples of one cortical surface, and by less if the surfaces differ.

    Parameters
    ----------
    points, others : array
        Equally many points, all of the same mass.
    blur : float
        The length scale of the regularisation, in units of the points: the root of the final temperature.

    Raises
    ------
    ValueError
        If the numbers of points differ, or the blur is not a positive number.

    Notes
    -----
    O(n²) time and memory. On a CPU the exact solver is faster at every size that fits into memory: 2 000 points take
    15 s here and 1 s there. This function is for comparison with published values, and for GPUs.

    References
    ----------
    Feydy et al., *Interpolating between optimal transport and MMD using Sinkhorn divergences*, AISTATS 2019.
    """
    _require_equal_counts(points, others)
    require_positive(blur, "blur", "units of the points, such as 0.1 mm")
    from geomloss import SamplesLoss

    loss = SamplesLoss("sinkhorn", p=2, blur=blur, scaling=0.95, debias=True, backend="tensorized")
    with torch.no_grad():
        half_squared = loss(torch.from_numpy(points), torch.from_numpy(others))
    return math.sqrt(max(0.0, 2 * float(half_squared)))


def sliced_distance(points: Float[Array, "n 3"], others: Float[Array, "n 3"], n_directions: int = 200) -> float:
    """SWD: SW₂, the root of the mean over directions of the squared W₂ of the projections, in the units of the points.

    The directions form a spiral on the half sphere, the same in every call.

    Raises
    ------
    ValueError
        If the numbers of points differ, or ``n_directions`` is not a positive integer.
    """
    _require_equal_counts(points, others)
    require_positive_integer(n_directions, "n_directions")
    total = 0.0
    for direction in half_sphere(n_directions):
        gap = np.sort(points @ direction) - np.sort(others @ direction)
        total += float(np.mean(gap * gap))
    return math.sqrt(total / n_directions)


def half_sphere(n: int) -> Float[Array, "n 3"]:
    """Evenly spread unit vectors on the upper half sphere: equal steps in height, rotated by the golden angle each."""
    height = (np.arange(n) + 0.5) / n
    angle = math.pi * (3 - math.sqrt(5)) * np.arange(n)
    radius = np.sqrt(1 - height**2)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)


def _require_equal_counts(points: Array, others: Array) -> None:
    if len(points) != len(others) or not len(points):
        raise ValueError(
            f"there are {len(points)} and {len(others)} points; equally many are needed, at least one: all carry "
            "the same mass"
        )


# Rigid alignment of two surfaces of one subject, for example from two scans.


@dataclasses.dataclass(frozen=True, eq=False)
class Alignment:
    """A surface after rigid alignment, and the remaining distance.

    Parameters
    ----------
    mesh : Mesh
        The source after the motion.
    rotation, translation : array
        x ↦ ``rotation`` x + ``translation``, in units of the vertices.
    residues : tuple of float
        The root mean squared distance from the source's points to the target's faces, before each step and after the
        last one. The last entry is the **residue** of the alignment.
    """

    mesh: Mesh
    rotation: Float[Array, "3 3"]
    translation: Float[Array, " 3"]
    residues: tuple[float, ...]

    @property
    def residue(self) -> float:
        """The last of ``residues``: the surfaces differ by it, or the iteration stopped early."""
        return self.residues[-1]

    @property
    def turn_degrees(self) -> float:
        """The angle of the rotation, in degrees."""
        sine = np.linalg.norm(self.rotation - self.rotation.T) / math.sqrt(8)
        return math.degrees(math.atan2(sine, (np.trace(self.rotation) - 1) / 2))


def rigidly_aligned(
    source: Mesh,
    target: Mesh,
    n_points: int = 20_000,
    generator: Generator = 0,
    max_steps: int = 100,
    tolerance: float = 1e-6,
) -> Alignment:
    """Align the source with the target by iterative closest points: rotation and translation, no scaling.

    Each step finds, for every one of ``n_points`` points of the source, the nearest point on the faces of the target.
    It then computes the motion that minimises the distances to the tangent planes there. If this motion increases the
    distance to the target, the step minimises the distances to the nearest points instead, which cannot increase it.
    The result is a local minimum. For a cortical surface the initial offset may be a few centimetres or about 20
    degrees, not more. The result depends on the random points by much less than the residue.

    Parameters
    ----------
    source, target : Mesh
        In the same space and unit. They should already overlap.
    n_points : int
        Number of points drawn on the source, uniformly by area.
    generator : numpy.random.Generator, torch.Generator or int
        Random number generator of these points; an integer is a seed.
    max_steps : int
        Maximum number of steps.
    tolerance : float
        The iteration stops when no point moves further than this in a step, in units of the vertices.

    Raises
    ------
    ValueError
        If a count is not a positive integer, the tolerance is not positive, or a mesh has zero area or is not finite.

    Warns
    -----
    UserWarning
        If the tolerance is not reached within ``max_steps`` steps.

    References
    ----------
    Besl and McKay, *A method for registration of 3-D shapes*, 1992; Chen and Medioni, *Object modelling by
    registration of multiple range images*, 1992.
    """
    require_positive_integer(max_steps, "max_steps")
    if not tolerance > 0:
        raise ValueError(f"tolerance is {tolerance!r}; a length > 0 is needed, in units of the vertices")
    goal, start = Surface(target), Surface(source).sample(n_points, generator).points
    points, residues = start, []
    nearest, normals = _feet(goal, points)
    for _ in range(max_steps):
        residues.append(_rms(points - nearest))
        moved = _apply(points, *_plane_step(points, nearest, normals))
        feet = _feet(goal, moved)
        if _rms(moved - feet[0]) > residues[-1]:
            moved = _apply(points, *_point_step(points, nearest))
            feet = _feet(goal, moved)
        step = float(np.linalg.norm(moved - points, axis=1).max())
        points, (nearest, normals) = moved, feet
        if step <= tolerance:
            break
    else:
        warnings.warn(f"the points still move by {step:.2g} after {max_steps} steps; allow more", stacklevel=2)
    rotation, translation = _point_step(start, points)
    vertices = source.vertices.detach().double().cpu().numpy() @ rotation.T + translation
    mesh = source.with_vertices(torch.from_numpy(vertices).to(source.vertices))
    return Alignment(mesh, rotation, translation, (*residues, _rms(points - nearest)))


def _feet(goal: Surface, points: Float[Array, "n 3"]) -> tuple[Float[Array, "n 3"], Float[Array, "n 3"]]:
    _, faces, nearest = goal.tree.squared_distance(goal.vertices, goal.faces, points)
    return nearest, goal.normals[faces]


def _rms(arrows: Float[Array, "n 3"]) -> float:
    return float(np.sqrt(np.square(arrows).sum(axis=1).mean()))


def _apply(points: Array, rotation: Array, translation: Array) -> Float[Array, "n 3"]:
    return points @ rotation.T + translation


def _plane_step(points: Array, nearest: Array, normals: Array) -> tuple[Float[Array, "3 3"], Float[Array, " 3"]]:
    """The small motion that minimises the distances of the points to the tangent planes at ``nearest``."""
    middle = points.mean(axis=0)
    rows = np.concatenate([np.cross(points - middle, normals), normals], axis=1)
    found = np.linalg.lstsq(rows, ((nearest - points) * normals).sum(axis=1), rcond=1e-9)[0]
    # The rotation about an axis by an angle equal to its length, in radians (Rodrigues).
    angle, rotation = float(np.linalg.norm(found[:3])), np.eye(3)
    if angle:
        x, y, z = found[:3] / angle
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        rotation = np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross
    return rotation, found[3:] + middle - rotation @ middle


def _point_step(points: Array, nearest: Array) -> tuple[Float[Array, "3 3"], Float[Array, " 3"]]:
    """The motion that minimises the mean squared distance between paired points (Kabsch)."""
    middles = points.mean(axis=0), nearest.mean(axis=0)
    left, _, right = np.linalg.svd((nearest - middles[1]).T @ (points - middles[0]))
    sign = np.sign(np.linalg.det(left @ right))
    rotation = left @ np.diag([1, 1, sign]) @ right
    return rotation, middles[1] - rotation @ middles[0]
