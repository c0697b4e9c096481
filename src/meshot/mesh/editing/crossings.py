"""Repair of self-intersections by local smoothing."""

import torch

from meshot.errors import require_positive_integer
from meshot.mesh.editing.smoothing import neighbour_means
from meshot.mesh.mesh import Mesh
from meshot.mesh.topology.intersection import self_intersecting_faces
from meshot.types import Bool, Int64, Tensor

_ROUNDS_PER_RING = 5
_AMOUNT = 0.5  # fraction of the way to the mean of the neighbours, in each round


def smooth_crossings(mesh: Mesh, max_rounds: int = 50) -> Mesh:
    """The mesh after local smoothing around intersecting faces until no faces intersect. Other vertices do not move.

    Each round counts the intersecting faces and moves nearby vertices half of the way to the mean of their neighbours.
    In the first five rounds only the corners of these faces move. After every five rounds the neighbourhood grows by a
    ring of vertices, so that small defects are repaired by small changes. Faces and topology stay the same.

    Parameters
    ----------
    mesh : Mesh
        Returned unchanged if no faces intersect.
    max_rounds : int
        Maximum number of rounds.

    Raises
    ------
    ValueError
        If ``max_rounds`` is not a positive integer, or faces still intersect after this many rounds.

    Notes
    -----
    Counting is exact (``self_intersecting_faces``) and takes most of the time: about .2 s per round for 80 000 faces.
    The method is meant for a few local defects, not for surfaces with many self-intersections.
    """
    require_positive_integer(max_rounds, "max_rounds")
    crossing = self_intersecting_faces(mesh)
    for round_ in range(max_rounds):
        if not len(crossing):
            return mesh
        moving = _ring_around(mesh, crossing, round_ // _ROUNDS_PER_RING)
        smoothed = torch.lerp(mesh.vertices, neighbour_means(mesh), _AMOUNT)
        mesh = mesh.with_vertices(torch.where(moving[:, None], smoothed, mesh.vertices))
        crossing = self_intersecting_faces(mesh)
    if len(crossing):
        raise ValueError(
            f"{len(crossing)} faces still cross after {max_rounds} rounds of smoothing, the first is face "
            f"{int(crossing[0])}: allow more rounds, or smooth or remesh the surface as a whole"
        )
    return mesh


def _ring_around(mesh: Mesh, faces: Int64[Tensor, " n"], n_rings: int) -> Bool[Tensor, " V"]:
    """Which vertices are corners of the faces, or at most ``n_rings`` edges away from a corner."""
    inside = torch.zeros(len(mesh.vertices), dtype=torch.bool, device=mesh.faces.device)
    inside[mesh.faces[faces].flatten()] = True
    for _ in range(n_rings):
        inside[mesh.faces[inside[mesh.faces].any(dim=1)].flatten()] = True
    return inside
