"""What a flow leaves with crossing faces, brought back to a surface without any."""

import dataclasses

import torch

from meshot.errors import require_positive_integer
from meshot.mesh import Mesh
from meshot.mesh.editing import neighbour_means, smooth_crossings
from meshot.mesh.topology import self_intersecting_faces

_MENDING_ROUNDS = 25
_LARGEST_SHARE = 0.01  # of the faces, for smoothing
_PART_KEPT = 0.5  # of the way from the initial surface, in each retreat
_BLUR_STEPS = 4


@dataclasses.dataclass(frozen=True, eq=False)
class RepairedSurface:
    """A surface without crossing faces, and what it took.

    Parameters
    ----------
    mesh : Mesh
        With the faces of the one that came.
    n_crossing : int
        Faces that crossed before.
    n_backtracks : int
        How many times places were brought closer to the initial surface, because smoothing alone did not help.
    largest_move : float
        How far the vertex that moved most was moved by all this, in units of the vertices.
    """

    mesh: Mesh
    n_crossing: int
    n_backtracks: int
    largest_move: float


def repair_crossings(initial: Mesh, carried: Mesh, max_backtracks: int = 8) -> RepairedSurface:
    """A carried surface, mended where faces cross; where that fails it goes back towards the initial surface.

    First :func:`meshot.mesh.editing.smooth_crossings`, which smooths a few places. Where that fails, or more than a
    hundredth of the faces cross, the displacement from the initial surface is halved around them, ever farther around,
    and what is left is smoothed again. If that is not enough either, the result is the initial surface, in which no
    faces cross.

    Parameters
    ----------
    initial, carried : Mesh
        With the same faces.
    max_backtracks : int

    Raises
    ------
    ValueError
        If the meshes have other faces, faces of the initial surface cross, or ``max_backtracks`` is not a positive
        integer.
    """
    require_positive_integer(max_backtracks, "max_backtracks")
    if carried.faces.shape != initial.faces.shape or not bool((carried.faces == initial.faces).all()):
        raise ValueError("the carried mesh has other faces than the initial one; carry the initial mesh itself")
    n_crossing = len(self_intersecting_faces(carried))
    if not n_crossing:
        return RepairedSurface(carried, 0, 0, 0.0)
    if len(self_intersecting_faces(initial)):
        raise ValueError("faces of the initial surface cross: there is nothing to go back to; mend it first")
    way, share, mesh = carried.vertices - initial.vertices, torch.ones_like(initial.vertices[:, 0]), carried
    for n_backtracks in range(max_backtracks + 1):
        found = _mended(mesh)
        if found is not None:
            break
        share = _lowered(share, initial, mesh, 2 + 2 * n_backtracks)
        mesh = initial.with_vertices(initial.vertices + share[:, None] * way)
    mesh = initial if found is None else found
    largest_move = float((mesh.vertices - carried.vertices).norm(dim=1).max())
    return RepairedSurface(mesh, n_crossing, n_backtracks, largest_move)


def _mended(mesh: Mesh) -> Mesh | None:
    """The mesh with its few defects smoothed; None if they are many, since that would smooth the folds away as well."""
    if len(self_intersecting_faces(mesh)) > _LARGEST_SHARE * len(mesh.faces):
        return None
    try:
        return smooth_crossings(mesh, _MENDING_ROUNDS)
    except ValueError:
        return None


def _lowered(share: torch.Tensor, initial: Mesh, mesh: Mesh, n_rings: int) -> torch.Tensor:
    """The share of the displacement that is kept, halved around the faces that cross, and blurred along the surface."""
    near = torch.zeros(len(share), dtype=torch.bool, device=share.device)
    near[mesh.faces[self_intersecting_faces(mesh)].flatten()] = True
    for _ in range(n_rings):
        near[mesh.faces[near[mesh.faces].any(dim=1)].flatten()] = True
    lowered = torch.where(near, _PART_KEPT * share, share)
    for _ in range(_BLUR_STEPS):
        means = neighbour_means(initial.with_vertices(lowered[:, None].expand(-1, 3).contiguous()))[:, 0]
        lowered = torch.minimum(lowered, means)
    return lowered
