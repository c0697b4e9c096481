"""Self-intersection of meshes under a flow: detection, bounds on the step size, and repair.

A flow with small steps is injective on points, but the triangles between moving vertices can still intersect. This
subpackage counts such faces along a flow, computes the Lipschitz constants in the bounds, and repairs moved surfaces.
"""

import contextlib
import dataclasses
import math
from collections.abc import Callable

import numpy as np
import torch

from meshot.errors import as_points, require_positive, require_positive_integer
from meshot.flow.fields import Velocity, VelocityField
from meshot.flow.integration import step_maps, trajectory
from meshot.mesh import (
    Mesh,
    crossing_pairs,
    face_normals,
    neighbour_means,
    ring_around,
    self_intersecting_faces,
    smooth_crossings,
    vertex_normals,
)
from meshot.types import Float, Tensor

# Jacobians of a velocity, and an estimate of its Lipschitz constant from below.


def point_jacobians(function: Callable[[Tensor], Tensor], points: Float[Tensor, "n d"]) -> Float[Tensor, "n d d"]:
    """The Jacobian at every point of a map that acts on each point separately: entry (i, j, k) is ∂f_j/∂x_k at point i.

    Needs d backward passes, for any number of points. Without gradient.
    """
    moving = points.detach().clone().requires_grad_()
    with torch.enable_grad():
        values = function(moving)
        if not values.requires_grad:
            return moving.new_zeros(*moving.shape, moving.shape[1])
        columns = range(values.shape[1])
        # A component that does not depend on the points has no gradient: materialize_grads gives zeros.
        rows = [
            torch.autograd.grad(values[:, j].sum(), moving, retain_graph=True, materialize_grads=True)[0]
            for j in columns
        ]
    return torch.stack(rows, dim=1)


def sampled_lipschitz(
    field: VelocityField | Velocity, points: Float[Tensor, "n d"], n_times: int = 4
) -> Float[Tensor, ""]:
    """The largest spectral norm of the velocity's Jacobian over the points and over equally spaced times.

    The result is a lower bound of the Lipschitz constant, per unit of time, and converges to it as the points become
    dense. There are ``n_times`` times in (0, 1). For an upper bound, see
    :meth:`meshot.flow.VelocityField.lipschitz_bound`.

    Raises
    ------
    ValueError
        If the points are not a matrix of finite floating-point numbers, or ``n_times`` < 1.
    """
    points = as_points(points, "points")
    require_positive_integer(n_times, "n_times")
    velocity = field.prepared() if isinstance(field, VelocityField) else field
    times = (torch.arange(n_times, dtype=points.dtype, device=points.device) + 0.5) / n_times
    norms = [
        torch.linalg.matrix_norm(point_jacobians(lambda x, t=time: velocity(t, x), points), ord=2).max()
        for time in times
    ]
    return torch.stack(norms).max()


# Diagnosis of a flow: Jacobians along the paths of points, and self-intersections of a mesh after each step.


@dataclasses.dataclass(frozen=True, eq=False)
class PathReport:
    """Local Jacobians of a flow along the paths of points.

    Parameters
    ----------
    positions : tensor
        Positions of the points before the first step and after each step.
    norms : tensor
        Spectral norm of the velocity's Jacobian at the start of every step: the local Lipschitz constant, per unit of
        time.
    determinants : tensor
        Determinant of the Jacobian of every step map: the factor by which the step scales a small volume. A value of
        zero or less means that the step reverses orientation there (a flip).
    """

    positions: Float[Tensor, "k n d"]
    norms: Float[Tensor, "n_steps n"]
    determinants: Float[Tensor, "n_steps n"]

    @property
    def steepest(self) -> float:
        """The largest local Lipschitz constant along the paths, per unit of time."""
        return float(self.norms.max())

    @property
    def n_flips(self) -> int:
        """The number of pairs of point and step where the step map reverses orientation."""
        return int((self.determinants <= 0).sum())

    @property
    def volume_factors(self) -> Float[Tensor, " n"]:
        """The factor by which the whole flow scales a small volume at each point."""
        return self.determinants.prod(dim=0)

    @property
    def step_times_lipschitz(self) -> float:
        """Step size times Lipschitz constant along the paths; below 1, every Euler step is injective near them."""
        return self.steepest / len(self.norms)

    @property
    def safe_steps(self) -> int:
        """The smallest number of equal steps with h·Lip < 1 along these paths."""
        return steps_below(self.steepest)


def steps_below(lipschitz: float, share: float = 1.0) -> int:
    """The smallest number of equal steps on [0, 1] for which step size · ``lipschitz`` < ``share``.

    Raises
    ------
    ValueError
        If ``lipschitz`` is negative or not finite (no step is small enough), or ``share`` is not positive.
    """
    if not 0 <= lipschitz < math.inf:
        raise ValueError(f"lipschitz is {lipschitz!r}; a finite number >= 0 is needed, or no step is small enough")
    if not share > 0:
        raise ValueError(f"share is {share!r}; a number > 0 is needed")
    return math.floor(lipschitz / share) + 1


def inspect_paths(
    field: VelocityField | Velocity, points: Float[Tensor, "n d"], n_steps: int = 12, method: str = "euler"
) -> PathReport:
    """Compute local Jacobians along the paths of the points, for the given integration method. Without gradient.

    Needs 2d backward passes per step. Says nothing about regions that no path visits.
    """
    positions = trajectory(field, points, n_steps, method).detach()
    velocity = field.prepared() if isinstance(field, VelocityField) else field
    norms, determinants = [], []
    for (time, step), before in zip(step_maps(velocity, points, n_steps, method), positions):
        slopes = point_jacobians(lambda x, t=time: velocity(t, x), before)
        norms.append(torch.linalg.matrix_norm(slopes, ord=2))
        determinants.append(torch.linalg.det(point_jacobians(step, before)))
    return PathReport(positions, torch.stack(norms), torch.stack(determinants))


@torch.no_grad()
def crossings_along(field: VelocityField | Velocity, mesh: Mesh, n_steps: int = 12, method: str = "euler") -> list[int]:
    """The number of self-intersecting faces before the first step and after each step, computed exactly.

    Uses ``self_intersecting_faces`` of ``meshot.mesh.connectivity``: about 1 s per step for 330 000 faces.
    """
    positions = trajectory(field, mesh.vertices, n_steps, method)
    return [len(self_intersecting_faces(mesh.with_vertices(p))) for p in positions]


# Repair of a surface that a flow has left with self-intersections.

_PART_KEPT = 0.5  # factor on the displacement in each backtrack
_BLUR_STEPS = 4


@dataclasses.dataclass(frozen=True, eq=False)
class RepairedSurface:
    """A surface without self-intersections, and statistics of its repair.

    Parameters
    ----------
    mesh : Mesh
        The repaired mesh, with the faces of the input.
    n_crossing : int
        Number of self-intersecting faces before the repair.
    n_backtracks : int
        How many times vertices were moved towards the initial surface because smoothing alone failed.
    largest_move : float
        Largest distance between a vertex before and after the repair, in units of the vertices.
    """

    mesh: Mesh
    n_crossing: int
    n_backtracks: int
    largest_move: float


def repair_crossings(
    initial: Mesh, carried: Mesh, max_backtracks: int = 8, max_rounds: int = 25, largest_share: float = 0.01
) -> RepairedSurface:
    """Repair the self-intersections of a moved surface by smoothing, and by moving it back where smoothing fails.

    The first attempt is :func:`meshot.mesh.smooth_crossings`. If it fails, or if too many faces
    intersect, the displacement from the initial surface is halved around these faces and the result is smoothed again.
    This is repeated in growing neighbourhoods, at most ``max_backtracks`` times. If intersections remain, the result is
    the initial surface.

    Parameters
    ----------
    initial, carried : Mesh
        The surface before and after the flow, with the same faces.
    max_backtracks : int
    max_rounds : int
        Maximum number of rounds of each smoothing. More rounds need fewer backtracks.
    largest_share : float
        Smoothing is tried if at most this share of the faces intersect. Smoothing a large share also removes folds.

    Raises
    ------
    ValueError
        If the meshes have different faces, the initial surface has self-intersections, ``max_backtracks`` or
        ``max_rounds`` is not a positive integer, or ``largest_share`` is not a share.
    """
    require_positive_integer(max_backtracks, "max_backtracks")
    require_positive_integer(max_rounds, "max_rounds")
    if not 0 < largest_share <= 1:
        raise ValueError(f"largest_share is {largest_share!r}; a share of the faces is needed, above 0 and at most 1")
    if carried.faces.shape != initial.faces.shape or not bool((carried.faces == initial.faces).all()):
        raise ValueError(
            "the carried mesh has other faces than the initial one; pass the initial mesh, moved by the flow"
        )
    crossing = self_intersecting_faces(carried)
    n_crossing = len(crossing)
    if not n_crossing:
        return RepairedSurface(carried, 0, 0, 0.0)
    if len(self_intersecting_faces(initial)):
        raise ValueError("the initial surface has self-intersecting faces; it must have none: repair it first")
    way, share, mesh = carried.vertices - initial.vertices, torch.ones_like(initial.vertices[:, 0]), carried
    for n_backtracks in range(max_backtracks + 1):
        # Smoothing many defects would also remove the folds.
        if len(crossing) <= largest_share * len(mesh.faces):
            with contextlib.suppress(ValueError):
                mesh = smooth_crossings(mesh, max_rounds)
                break
        # The factors on the displacement are halved around intersecting faces, then blurred along the surface.
        near = ring_around(mesh, crossing, 2 + 2 * n_backtracks)
        share = torch.where(near, _PART_KEPT * share, share)
        for _ in range(_BLUR_STEPS):
            means = neighbour_means(initial.with_vertices(share[:, None].expand(-1, 3).contiguous()))[:, 0]
            share = torch.minimum(share, means)
        mesh = initial.with_vertices(initial.vertices + share[:, None] * way)
        crossing = self_intersecting_faces(mesh)
    else:
        mesh = initial
    largest_move = float((mesh.vertices - carried.vertices).norm(dim=1).max())
    return RepairedSurface(mesh, n_crossing, n_backtracks, largest_move)


# An inner and an outer surface that cross neither themselves nor each other.

_LEAST_COSINE, _DIRECTION_ROUNDS = 0.1, 300
_GOAL_ROUNDS = 60  # of smoothing where faces of the outer surface intersect
_ROUNDS_PER_RING = 10
_SMALLEST_GAP = 1 / 16  # as a share of the gap


def nest_surfaces(
    inner: Mesh, outer: Mesh, gap: float = 0.05, n_steps: int = 5, max_rounds: int = 100
) -> tuple[Mesh, Mesh]:
    """An inner surface and an outer one that corresponds to it, changed so that no face intersects another.

    The outer surface begins as a copy of the inner one, moved outwards by ``gap``, and advances towards its goal in
    equal steps. A vertex stops for a step where a face at it would intersect another face. So where banks of a sulcus
    meet, they stop at each other, and no step creates an intersection. The goal is the given outer surface, after local
    smoothing where its faces intersect. Before, the gap is halved, down to a sixteenth, where the copy or the inner
    surface intersects something. The inner surface is smoothed locally at creases that have no outer side, and where
    the smallest gap is too large, until it and its copy intersect nowhere.

    Parameters
    ----------
    inner, outer : Mesh
        Closed, oriented outwards, with the same faces. Each may consist of several surfaces, such as those of both
        hemispheres. They then stay apart, too.
    gap : float
        In units of the vertices. Where the outer surface cannot advance, it lies this far from the inner one, or less.
    n_steps : int
    max_rounds : int
        Of halved gaps and smoothing.

    Returns
    -------
    tuple of Mesh
        Both surfaces, with the faces that came.

    Raises
    ------
    ValueError
        If the faces differ, ``gap`` is not positive, a count is not a positive integer, or the inner surface and its
        copy still intersect after ``max_rounds``.

    Notes
    -----
    The moves are tested exactly, like those of FreeSurfer's deformation of surfaces, which also stops vertices before
    faces intersect (Dale, Fischl and Sereno, *Cortical surface-based analysis I*, NeuroImage 1999).
    Some ten seconds of one core for 100 000 faces.
    """
    require_positive(gap, "gap", "units of the vertices")
    require_positive_integer(n_steps, "n_steps")
    require_positive_integer(max_rounds, "max_rounds")
    if not torch.equal(inner.faces, outer.faces):
        raise ValueError("the outer surface has other faces than the inner one; take surfaces that correspond")
    n_vertices = len(inner.vertices)
    goal = smooth_crossings(outer, _GOAL_ROUNDS, strict=False).vertices
    faces = torch.cat([inner.faces, inner.faces + n_vertices])
    both, pairs = Mesh(torch.cat([inner.vertices, inner.vertices]), faces), None

    def moved_to(first: Tensor, second: Tensor) -> None:
        """Move both surfaces, and test again where something moved."""
        nonlocal both, pairs
        after = both.with_vertices(torch.cat([first, second]))
        if pairs is None:
            pairs = crossing_pairs(after)
        else:
            pairs = crossing_pairs(after, pairs, (after.vertices != both.vertices).any(dim=1))
        both = after

    def crossing_vertices(n_rings: int = 0) -> Tensor:
        """Whether a vertex of both surfaces belongs to a face that intersects another, or lies near one."""
        return ring_around(both, torch.from_numpy(np.unique(pairs)).to(faces.device), n_rings)

    gaps = torch.full_like(inner.vertices[:, :1], gap)
    for round_ in range(max_rounds):
        directions, least = outward_directions(inner)
        moved_to(inner.vertices, inner.vertices + gaps * directions)
        if not len(pairs):
            break
        n_rings = round_ // _ROUNDS_PER_RING
        near = crossing_vertices(n_rings).unflatten(0, (2, n_vertices)).any(dim=0)
        narrow = gaps[:, 0] <= _SMALLEST_GAP * gap
        rough = near & ((least <= 0) | narrow | (n_rings > 0))
        gaps = torch.where((near & ~narrow)[:, None], gaps / 2, gaps)
        smoothed = torch.lerp(inner.vertices, neighbour_means(inner), 0.5)
        inner = inner.with_vertices(torch.where(rough[:, None], smoothed, inner.vertices))
    else:
        raise ValueError(
            f"{len(np.unique(pairs))} faces of the inner surface and its copy {gap:g} outside still cross after "
            f"{max_rounds} rounds: smooth the surface, or allow more rounds"
        )
    place = both.vertices[n_vertices:]
    for left in range(n_steps, 0, -1):
        before, following = place, place + (goal - place) / left
        moved_to(inner.vertices, following)
        while len(pairs):
            following = torch.where(crossing_vertices()[n_vertices:, None], before, following)
            moved_to(inner.vertices, following)
        place = following
    return inner, inner.with_vertices(place)


def outward_directions(mesh: Mesh) -> tuple[Float[Tensor, "V 3"], Float[Tensor, " V"]]:
    """At every vertex a unit vector to the outer side of all faces around it, and the least cosine to their normals.

    If that cosine is not positive, no such vector was found. The normal of the vertex is taken where its least cosine
    is at least 0.1. At a crease it may lie behind a face. There the vector points to the place in the convex hull of
    the normals that is nearest to 0: no vector has a larger least cosine. It is found by Gilbert's algorithm (*An
    iterative procedure for computing the minimum of a quadratic form on a convex set*, SIAM J. Control, 1966).
    """
    normals, found = face_normals(mesh), vertex_normals(mesh)
    corners = mesh.faces.flatten()
    face = torch.arange(len(mesh.faces), device=corners.device).repeat_interleave(3)
    least = torch.full_like(found[:, 0], torch.inf)
    least = least.scatter_reduce(0, corners, dot(found[corners], normals[face]), "amin")
    poor = torch.nonzero(least < _LEAST_COSINE)[:, 0]
    chosen = (least < _LEAST_COSINE)[corners]
    at, face = torch.searchsorted(poor, corners[chosen]), face[chosen]
    places = found[poor]
    for _ in range(_DIRECTION_ROUNDS):
        if not len(at):
            break
        cosines = dot(places[at], normals[face]) / places.norm(dim=1).clamp(min=1e-30)[at]
        lowest = torch.full_like(places[:, 0], torch.inf).scatter_reduce(0, at, cosines, "amin")[at]
        # Vertices whose vector lies outside of all faces are finished.
        unfinished = lowest < _LEAST_COSINE
        at, face, farthest = at[unfinished], face[unfinished], (cosines <= lowest)[unfinished]
        goals = places.clone()
        goals[at[farthest]] = normals[face[farthest]]
        # The point of the segment from the place to the farthest normal that is nearest to 0.
        ways = places - goals
        shares = (dot(places, ways) / dot(ways, ways).clamp(min=1e-30)).clamp(0, 1)
        places = places - shares[:, None] * ways
    found, least = found.clone(), least.clone()
    found[poor] = torch.nn.functional.normalize(places, dim=1)
    cosines = dot(found[corners[chosen]], normals[torch.nonzero(chosen)[:, 0] // 3])
    least[corners[chosen]] = torch.inf
    return found, least.scatter_reduce(0, corners[chosen], cosines, "amin")


def dot(first: Float[Tensor, "n 3"], second: Float[Tensor, "n 3"]) -> Float[Tensor, " n"]:
    """The scalar products of rows: of three columns faster than a sum over an axis."""
    return first[:, 0] * second[:, 0] + first[:, 1] * second[:, 1] + first[:, 2] * second[:, 2]
