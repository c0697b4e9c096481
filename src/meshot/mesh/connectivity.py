"""Topological counts, which depend on the faces only."""

import dataclasses

import igl.predicates
import numpy as np
import scipy.sparse
import scipy.sparse.csgraph
import torch

from meshot.mesh.geometry import directed_edges, edge_counts
from meshot.mesh.mesh import Mesh
from meshot.types import Int64, Tensor


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
    vertices = mesh.vertices.detach().double().cpu().numpy()
    merged, index = np.unique(vertices, axis=0, return_inverse=True)
    faces = index.reshape(-1)[mesh.faces.cpu().numpy()]
    # A face with coincident corners has no interior that could intersect another face.
    kept = np.flatnonzero((faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0]))
    if not len(kept):
        return torch.zeros(0, dtype=torch.int64, device=mesh.faces.device)
    pairs = igl.predicates.find_self_intersections(merged, np.ascontiguousarray(faces[kept]))[1]
    found = kept[np.unique(np.asarray(pairs, dtype=np.int64))]
    return torch.from_numpy(found.astype(np.int64)).to(mesh.faces.device)
