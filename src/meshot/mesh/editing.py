"""Operations that make a new mesh: smoothing, repair of self-intersections, subdivision, decimation.

Every function returns a new mesh and does not modify its argument. Each docstring says whether the faces stay the same.
"""

from collections.abc import Callable, Sequence

import igl
import numpy as np
import torch

from meshot.errors import as_indices, require_natural, require_positive, require_positive_integer, require_shape
from meshot.mesh.connectivity import crossing_pairs
from meshot.mesh.geometry import mesh_edges
from meshot.mesh.mesh import Mesh
from meshot.types import Bool, Float, Int64, Tensor

# Smoothing of meshes, for example of the voxel steps in a surface extracted from an image.


def neighbour_means(mesh: Mesh) -> Float[Tensor, "V 3"]:
    """The mean of the neighbours of every vertex, weighted by the number of faces that share the edge.

    A vertex without neighbours keeps its own position.
    """
    ends = mesh.faces
    source = torch.cat([ends, ends], dim=1).T.reshape(-1)
    other = torch.cat([ends.roll(1, dims=1), ends.roll(-1, dims=1)], dim=1).T.reshape(-1)
    total = torch.zeros_like(mesh.vertices).index_add(0, source, mesh.vertices[other])
    count = torch.zeros_like(mesh.vertices[:, 0]).index_add(0, source, torch.ones_like(mesh.vertices[other, 0]))
    return torch.where(count[:, None] > 0, total / count.clamp(min=1)[:, None], mesh.vertices)


def laplacian_smoothing(mesh: Mesh, n_steps: int, amount: float = 0.5) -> Mesh:
    """The mesh after ``n_steps`` steps that move each vertex towards the mean of its neighbours. The mesh shrinks.

    A step leads over the fraction ``amount`` of the way to the mean, in (0, 1].

    Raises
    ------
    ValueError
        If ``n_steps`` is negative or ``amount`` is outside (0, 1].
    """
    require_natural(n_steps, "n_steps")
    if not 0 < amount <= 1:
        raise ValueError(f"amount is {amount!r}; a number in (0, 1] is needed, the part of the way to the neighbours")
    for _ in range(n_steps):
        mesh = mesh.with_vertices(torch.lerp(mesh.vertices, neighbour_means(mesh), amount))
    return mesh


def taubin_smoothing(mesh: Mesh, n_steps: int, amount: float = 0.5, pass_band: float = 0.1) -> Mesh:
    """The mesh after ``n_steps`` pairs of Laplacian steps, inwards and outwards, which limits shrinkage.

    Parameters
    ----------
    mesh : Mesh
    n_steps : int
    amount : float
        λ, the fraction of the way to the mean of the neighbours in the inward step, in (0, 1].
    pass_band : float
        k = 1/λ + 1/μ > 0: components of the shape with eigenvalues of the Laplacian below k are kept.

    Raises
    ------
    ValueError
        If ``n_steps`` is negative, ``amount`` is outside (0, 1], or ``pass_band`` is outside (0, 1/λ).

    References
    ----------
    Taubin, *A signal processing approach to fair surface design*, SIGGRAPH 1995.
    """
    require_natural(n_steps, "n_steps")
    if not (0 < amount <= 1 and 0 < pass_band < 1 / amount):
        raise ValueError(
            f"amount is {amount!r} and pass_band {pass_band!r}; amount must lie in (0, 1], pass_band in (0, 1/amount)"
        )
    back = 1 / (pass_band - 1 / amount)
    for _ in range(n_steps):
        for step in (amount, back):
            mesh = mesh.with_vertices(torch.lerp(mesh.vertices, neighbour_means(mesh), step))
    return mesh


# Repair of self-intersections by local smoothing.

_ROUNDS_PER_RING = 5
_AMOUNT = 0.5  # fraction of the way to the mean of the neighbours, in each round


def smooth_crossings(mesh: Mesh, max_rounds: int = 50, strict: bool = True) -> Mesh:
    """The mesh after local smoothing around intersecting faces until no faces intersect. Other vertices do not move.

    Each round counts the intersecting faces and moves nearby vertices half of the way to the mean of their neighbours.
    In the first five rounds only the corners of these faces move. After every five rounds the neighbourhood grows by a
    ring of vertices, so that small defects are repaired by small changes. Faces and topology stay the same. Unless
    ``strict``, the mesh is returned as it is after the last round, also if faces still intersect.

    Raises
    ------
    ValueError
        If ``max_rounds`` is not a positive integer, or faces still intersect after this many rounds.

    Notes
    -----
    Counting is exact (``self_intersecting_faces``). After the first round, only faces near those that moved are tested.
    The method is meant for a few local defects, not for surfaces with many self-intersections.
    """
    require_positive_integer(max_rounds, "max_rounds")
    pairs = crossing_pairs(mesh)
    for round_ in range(max_rounds):
        if not len(pairs):
            return mesh
        crossing = torch.from_numpy(np.unique(pairs)).to(mesh.faces.device)
        moving = ring_around(mesh, crossing, round_ // _ROUNDS_PER_RING)
        smoothed = torch.lerp(mesh.vertices, neighbour_means(mesh), _AMOUNT)
        mesh = mesh.with_vertices(torch.where(moving[:, None], smoothed, mesh.vertices))
        pairs = crossing_pairs(mesh, pairs, moving)
    if strict and len(pairs):
        crossing = np.unique(pairs)
        raise ValueError(
            f"{len(crossing)} faces still cross after {max_rounds} rounds of smoothing, the first is face "
            f"{int(crossing[0])}: allow more rounds, or smooth or remesh the surface as a whole"
        )
    return mesh


def ring_around(mesh: Mesh, faces: Int64[Tensor, " n"], n_rings: int) -> Bool[Tensor, " V"]:
    """Which vertices are corners of the faces, or at most ``n_rings`` edges away from a corner."""
    inside = torch.zeros(len(mesh.vertices), dtype=torch.bool, device=mesh.faces.device)
    inside[mesh.faces[faces].flatten()] = True
    for _ in range(n_rings):
        inside[mesh.faces[inside[mesh.faces].any(dim=1)].flatten()] = True
    return inside


# Reduction of the number of faces of a mesh.


def decimated(mesh: Mesh, n_faces: int) -> Mesh:
    """The mesh with about ``n_faces`` faces, after its shortest edges have been collapsed to their midpoints.

    The mesh may be closed or open, and must be manifold. It is returned unchanged if it has at most ``n_faces`` faces.
    An edge is collapsed only if the topology stays the same. The result may have self-intersections: check it with
    :func:`meshot.mesh.self_intersecting_faces`.

    Raises
    ------
    ValueError
        If ``n_faces`` < 1.
    """
    return _collapsed(mesh, n_faces, igl.decimate)


def simplified(mesh: Mesh, n_faces: int) -> Mesh:
    """The mesh with about ``n_faces`` faces, simplified by the quadric error metric.

    Closer to the surface than :func:`meshot.mesh.decimated` (by a factor of four for a cortex reduced from
    80 000 to 20 000 faces), with larger triangles where the surface is flat. The result may have self-intersections:
    check it with :func:`meshot.mesh.self_intersecting_faces`. Meshes as for :func:`meshot.mesh.decimated`.

    Raises
    ------
    ValueError
        If ``n_faces`` < 1.

    References
    ----------
    Garland and Heckbert, *Surface simplification using quadric error metrics*, SIGGRAPH 1997.
    """
    return _collapsed(mesh, n_faces, igl.qslim)


def _collapsed(mesh: Mesh, n_faces: int, collapse: Callable) -> Mesh:
    require_positive_integer(n_faces, "n_faces")
    if len(mesh.faces) <= n_faces:
        return mesh
    found = collapse(mesh.vertices.detach().double().cpu().numpy(), mesh.faces.cpu().numpy(), n_faces)
    vertices, faces = (part for part in found if isinstance(part, np.ndarray) and part.ndim == 2)
    return Mesh(
        torch.from_numpy(np.ascontiguousarray(vertices)).to(mesh.vertices),
        torch.from_numpy(np.ascontiguousarray(faces, dtype=np.int64)).to(mesh.faces.device),
    )


# Several meshes as one.


def united(meshes: Sequence[Mesh]) -> Mesh:
    """Several meshes joined to one, with vertices and faces in their order.

    Raises
    ------
    ValueError
        If there is no mesh.
    """
    if not meshes:
        raise ValueError("meshes is empty; at least one is needed")
    offsets = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])]).tolist()
    faces = [mesh.faces + offset for mesh, offset in zip(meshes, offsets, strict=True)]
    return Mesh(torch.cat([mesh.vertices for mesh in meshes]), torch.cat(faces))


# Subdivision of selected edges: more vertices on the same surface.


def with_edges_split(mesh: Mesh, edges: Int64[Tensor, "E 2"]) -> Mesh:
    """The same surface with a new vertex at the midpoint of each given edge, and with its faces divided there.

    A face with one, two or three given edges is divided into two, three or four faces. Old vertices keep their indices;
    the vertex on the k-th edge has index V + k. Orientation and topology stay the same. The edges are at least one pair
    of vertex indices, in any order, each edge once; see :func:`meshot.mesh.mesh_edges`.

    Raises
    ------
    ValueError
        If there is no pair, or a pair is not an edge of the mesh or appears twice.
    """
    n_vertices = len(mesh.vertices)
    edges = as_indices(edges, "edges", n_vertices).to(mesh.faces.device)
    require_shape(edges, "edges", 2)
    # The index of the new vertex on the sides ab, bc, ca of every face, (F, 3); −1 if the side is not divided.
    sides = torch.stack([mesh.faces, mesh.faces.roll(-1, dims=1)], dim=2).sort(dim=2).values
    wanted = edges.sort(dim=1).values
    wanted, order = torch.sort(wanted[:, 0] * n_vertices + wanted[:, 1])
    if bool((wanted.diff() == 0).any()):
        raise ValueError("edges names an edge twice; name each once")
    sides = sides[..., 0] * n_vertices + sides[..., 1]
    place = torch.searchsorted(wanted, sides).clamp(max=len(edges) - 1)
    found = wanted[place] == sides
    known = torch.zeros(len(edges), dtype=torch.bool, device=edges.device)
    known[place[found]] = True
    if not bool(known.all()):
        pair = edges[order[~known][0]].tolist()
        raise ValueError(f"edges names {pair}, which no face has for a side; take pairs from mesh_edges")
    new = torch.where(found, n_vertices + order[place], -1)
    marks = (new >= 0).long()
    # Rotate the corners so that a single divided edge is ab, and a single undivided edge is ca.
    count = marks.sum(dim=1)
    turn = torch.where(count == 1, marks.argmax(dim=1), torch.where(count == 2, marks.argmin(dim=1) + 1, 0))
    order = (torch.arange(3, device=turn.device) + turn[:, None]) % 3
    a, b, c = mesh.faces.gather(1, order).T
    ab, bc, ca = new.gather(1, order).T
    parts = [
        _faces(count == 0, (a, b, c)),
        _faces(count == 1, (a, ab, c), (ab, b, c)),
        _faces(count == 2, (ab, b, bc), (a, ab, bc), (a, bc, c)),
        _faces(count == 3, (a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)),
    ]
    return Mesh(torch.cat([mesh.vertices, mesh.vertices[edges].mean(dim=1)]), torch.cat(parts))


def edge_splits(mesh: Mesh, longest: float) -> list[Int64[Tensor, "E 2"]]:
    """The edges to be halved, round after round, until no edge is longer than a length.

    Each entry is an argument of :func:`meshot.mesh.with_edges_split`, for the mesh that the rounds before it have made.
    The list is empty if all edges are short enough.

    Raises
    ------
    ValueError
        If the length is not a positive number.
    """
    require_positive(longest, "longest", "units of the vertices")
    rounds = []
    while True:
        edges = mesh_edges(mesh)
        ends = mesh.vertices.detach()[edges]
        long = (ends[:, 0] - ends[:, 1]).norm(dim=1) > longest
        if not bool(long.any()):
            return rounds
        rounds.append(edges[long])
        mesh = with_edges_split(mesh, rounds[-1])


def _faces(which: Bool[Tensor, " F"], *parts: tuple[Tensor, Tensor, Tensor]) -> Int64[Tensor, "G 3"]:
    return torch.cat([torch.stack(part, dim=1)[which] for part in parts])
