"""Repair of a surface that a flow has left with self-intersections."""

import dataclasses

import torch

from meshot.errors import require_positive_integer
from meshot.mesh import Mesh
from meshot.mesh.editing import neighbour_means, smooth_crossings
from meshot.mesh.topology import self_intersecting_faces

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

    The first attempt is :func:`meshot.mesh.editing.smooth_crossings`. If it fails, or if too many faces
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
    n_crossing = len(self_intersecting_faces(carried))
    if not n_crossing:
        return RepairedSurface(carried, 0, 0, 0.0)
    if len(self_intersecting_faces(initial)):
        raise ValueError("the initial surface has self-intersecting faces; it must have none: repair it first")
    way, share, mesh = carried.vertices - initial.vertices, torch.ones_like(initial.vertices[:, 0]), carried
    for n_backtracks in range(max_backtracks + 1):
        found = _mended(mesh, max_rounds, largest_share)
        if found is not None:
            break
        share = _lowered(share, initial, mesh, 2 + 2 * n_backtracks)
        mesh = initial.with_vertices(initial.vertices + share[:, None] * way)
    mesh = initial if found is None else found
    largest_move = float((mesh.vertices - carried.vertices).norm(dim=1).max())
    return RepairedSurface(mesh, n_crossing, n_backtracks, largest_move)


def _mended(mesh: Mesh, max_rounds: int, largest_share: float) -> Mesh | None:
    """The mesh with its few defects smoothed; None if there are many, since smoothing would also remove the folds."""
    if len(self_intersecting_faces(mesh)) > largest_share * len(mesh.faces):
        return None
    try:
        return smooth_crossings(mesh, max_rounds)
    except ValueError:
        return None


def _lowered(share: torch.Tensor, initial: Mesh, mesh: Mesh, n_rings: int) -> torch.Tensor:
    """The factors on the displacement: halved around intersecting faces, then blurred along the surface."""
    near = torch.zeros(len(share), dtype=torch.bool, device=share.device)
    near[mesh.faces[self_intersecting_faces(mesh)].flatten()] = True
    for _ in range(n_rings):
        near[mesh.faces[near[mesh.faces].any(dim=1)].flatten()] = True
    lowered = torch.where(near, _PART_KEPT * share, share)
    for _ in range(_BLUR_STEPS):
        means = neighbour_means(initial.with_vertices(lowered[:, None].expand(-1, 3).contiguous()))[:, 0]
        lowered = torch.minimum(lowered, means)
    return lowered
