"""Faces that cross, smoothed apart where they do, and nowhere else."""

import torch

from meshot.errors import require_positive_integer
from meshot.mesh.editing.smoothing import neighbour_means
from meshot.mesh.mesh import Mesh
from meshot.mesh.topology.intersection import self_intersecting_faces
from meshot.types import Bool, Int64, Tensor

_ROUNDS_PER_RING = 5
_AMOUNT = 0.5  # part of the way to the mean of the neighbours, in each round


def smooth_crossings(mesh: Mesh, max_rounds: int = 50) -> Mesh:
    """The mesh with the neighbourhood of crossing faces smoothed until no faces cross; every other vertex stays.

    A round counts the crossing faces and lets their corners, and the vertices around them, go half of the way to the
    mean of their neighbours. In the first five rounds only the corners move, and in every five that follow one ring of
    neighbours more: small defects are mended by small changes. Faces stay as they are, and so does the topology.

    Parameters
    ----------
    mesh : Mesh
        Returned as it is if no faces cross.
    max_rounds : int

    Raises
    ------
    ValueError
        If ``max_rounds`` is not a positive integer, or faces still cross after so many rounds.

    Notes
    -----
    A round counts exactly (``self_intersecting_faces``), which takes most of its time:
    about .2 s for 80 000 faces. Meant for a few defects; a surface that crosses itself far and wide needs to be made
    differently.
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
    """Which vertices are corners of the faces, or at most so many edges away from one."""
    inside = torch.zeros(len(mesh.vertices), dtype=torch.bool, device=mesh.faces.device)
    inside[mesh.faces[faces].flatten()] = True
    for _ in range(n_rings):
        inside[mesh.faces[inside[mesh.faces].any(dim=1)].flatten()] = True
    return inside
