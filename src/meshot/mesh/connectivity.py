"""Topological counts, which depend on the faces only."""

import dataclasses

import igl.predicates
import numpy as np
import scipy.sparse
import scipy.sparse.csgraph
import torch

from meshot.mesh.geometry import directed_edges, edge_counts
from meshot.mesh.mesh import Mesh
from meshot.types import Array, Bool, Float, Int64, Tensor


def euler_number(mesh: Mesh) -> int:
    """V − E + F: 2 for a sphere, 2 − 2g for a closed surface with g handles. Vertices without a face do not count."""
    return len(torch.unique(mesh.faces)) - len(edge_counts(mesh)[0]) + len(mesh.faces)


def boundary_edges(mesh: Mesh) -> Int64[Tensor, "E 2"]:
    """The edges that belong to exactly one face. A closed mesh has none."""
    edges, counts = edge_counts(mesh)
    return edges[counts == 1]


def nonmanifold_edges(mesh: Mesh) -> Int64[Tensor, "E 2"]:
    """The edges that belong to more than two faces."""
    edges, counts = edge_counts(mesh)
    return edges[counts > 2]


def component_labels(mesh: Mesh) -> Int64[Tensor, " F"]:
    """The number, from 0, of the connected component of every face. Faces are connected if they share a vertex."""
    faces = mesh.faces.cpu().numpy()
    n_vertices = len(mesh.vertices)
    pairs = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]]])
    graph = scipy.sparse.coo_matrix((np.ones(len(pairs), dtype=bool), pairs.T), shape=(n_vertices, n_vertices))
    labels = scipy.sparse.csgraph.connected_components(graph, directed=False)[1][faces[:, 0]]
    return torch.from_numpy(np.unique(labels, return_inverse=True)[1].astype(np.int64)).to(mesh.faces.device)


def is_consistently_oriented(mesh: Mesh) -> bool:
    """Whether every shared edge has opposite directions in its two faces, so that normals lie on the same side."""
    directed = directed_edges(mesh)
    return len(torch.unique(directed[:, 0] * len(mesh.vertices) + directed[:, 1])) == len(directed)


@dataclasses.dataclass(frozen=True)
class Topology:
    """Topological counts of a mesh. They show whether it is a closed surface, and its genus."""

    euler_number: int
    n_components: int
    n_boundary_edges: int
    n_nonmanifold_edges: int
    consistently_oriented: bool


SPHERE = Topology(2, 1, 0, 0, True)


def topology(mesh: Mesh) -> Topology:
    """Euler number, components, boundary and non-manifold edges, orientation. Equal to ``SPHERE`` for a sphere."""
    return Topology(
        euler_number(mesh),
        int(component_labels(mesh).max()) + 1,
        len(boundary_edges(mesh)),
        len(nonmanifold_edges(mesh)),
        is_consistently_oriented(mesh),
    )


# Detection of self-intersections of a mesh.


def self_intersecting_faces(mesh: Mesh) -> Int64[Tensor, " n"]:
    """The faces that intersect, touch or overlap another face outside the edge or corner that they share.

    The result has ascending indices into ``mesh.faces``, each once. The mesh is tested in double precision with exact
    predicates. Vertices at the same position are merged first, so that adjacent faces of a triangle soup do not count
    as touching.

    Notes
    -----
    Computed by libigl's ``find_self_intersections``, in about 1 s for 330 000 faces.
    """
    return torch.from_numpy(np.unique(crossing_pairs(mesh))).to(mesh.faces.device)


def crossing_pairs(
    mesh: Mesh, before: Int64[Array, "m 2"] | None = None, moved: Bool[Tensor, " V"] | None = None
) -> Int64[Array, "n 2"]:
    """The pairs of faces that :func:`self_intersecting_faces` finds.

    With ``before``, the pairs when the vertices ``moved`` were elsewhere, only faces near a moved one are tested.
    """
    vertices, faces = mesh.vertices.detach().double().cpu().numpy(), mesh.faces.cpu().numpy()
    if before is None:
        return _pairs_among(vertices, faces, np.arange(len(faces)))
    touched = moved.cpu().numpy()[faces].any(axis=1)
    found = _pairs_among(vertices, faces, np.flatnonzero(_near(vertices, faces, touched)))
    return np.concatenate([before[~touched[before].any(axis=1)], found[touched[found].any(axis=1)]])


def _pairs_among(
    vertices: Float[Array, "V 3"], faces: Int64[Array, "F 3"], chosen: Int64[Array, " n"]
) -> Int64[Array, "m 2"]:
    corners = faces[chosen]
    used, corners = np.unique(corners, return_inverse=True)
    merged, index = np.unique(vertices[used], axis=0, return_inverse=True)
    corners = index.reshape(-1)[corners.reshape(-1, 3)]
    # A face with coincident corners has no interior that could intersect another face.
    a, b, c = corners.T
    kept = np.flatnonzero((a != b) & (b != c) & (c != a))
    if not len(kept):
        return np.zeros((0, 2), dtype=np.int64)
    pairs = igl.predicates.find_self_intersections(merged, np.ascontiguousarray(corners[kept]))[1]
    return chosen[kept[np.asarray(pairs, dtype=np.int64).reshape(-1, 2)]].astype(np.int64)


def _near(vertices: Float[Array, "V 3"], faces: Int64[Array, "F 3"], touched: Bool[Array, " F"]) -> Bool[Array, " F"]:
    """The faces whose bounding box shares a cell of a grid with the box of a touched face, and so all that meet it."""
    # Minima of three arrays are ten times as fast as one minimum along an axis of three.
    first, second, third = (vertices[faces[:, corner]] for corner in range(3))
    low = np.minimum(np.minimum(first, second), third)
    high = np.maximum(np.maximum(first, second), third)
    origin, end = low.min(axis=0), high.max(axis=0)
    across = high - low
    widths = np.maximum(np.maximum(across[:, 0], across[:, 1]), across[:, 2])
    size = max(2 * float(np.median(widths)), float((end - origin).max()) / 250) or 1.0
    first, last, shape = (((x - origin) / size).astype(np.int64) for x in (low, high, end))
    spans, shape = last - first + 1, shape + 1
    # One row for each cell of each box: the number of the face, and that of the cell.
    counts = spans.prod(axis=1)
    face = np.repeat(np.arange(len(faces)), counts)
    rank = np.arange(len(face)) - np.repeat(np.cumsum(counts) - counts, counts)
    cell = np.zeros_like(face)
    for axis in range(3):
        rank, step = np.divmod(rank, spans[face, axis])
        cell = cell * shape[axis] + first[face, axis] + step
    marked = np.zeros(int(shape.prod()), dtype=bool)
    marked[cell[touched[face]]] = True
    near = np.zeros(len(faces), dtype=bool)
    near[face[marked[cell]]] = True
    return near
