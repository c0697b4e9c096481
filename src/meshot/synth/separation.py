"""Removal of self-intersections, and of intersections between surfaces of one head."""

import numpy as np
import scipy.spatial
import torch

from meshot.mesh import Mesh
from meshot.mesh.editing import smooth_crossings
from meshot.mesh.topology import self_intersecting_faces
from meshot.types import Float, Int64, Tensor

#: Vertices are rounded to multiples of 2⁻¹³ mm. Single precision represents them exactly, and the last bits of sums,
#: which differ between CPUs, are removed.
LATTICE = 2.0**-13
_REACH = 4.0  # mm around intersecting faces
_ROUNDS = 5
_SMOOTHINGS = 60


def on_lattice(points: Float[Tensor, "n 3"]) -> Float[Tensor, "n 3"]:
    """The points rounded to multiples of 2⁻¹³ mm (.00012 mm)."""
    return (points / LATTICE).round() * LATTICE


def united(meshes: list[Mesh]) -> Mesh:
    """Several meshes joined to one, with vertices and faces in their order.

    Raises
    ------
    ValueError
        If there is none.
    """
    if not meshes:
        raise ValueError("meshes is empty; at least one is needed")
    offsets = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])]).tolist()
    faces = [mesh.faces + offset for mesh, offset in zip(meshes, offsets, strict=True)]
    return Mesh(torch.cat([mesh.vertices for mesh in meshes]), torch.cat(faces))


def crossing_faces(meshes: list[Mesh]) -> Int64[Tensor, " n"]:
    """The faces that intersect another face of the same or another mesh, as indices into the joined meshes.

    If there are none, and the meshes are closed, any two of them are nested or disjoint.

    Raises
    ------
    ValueError
        If there is no mesh.
    """
    return self_intersecting_faces(united(meshes))


def kept_apart(meshes: list[Mesh]) -> list[Mesh] | None:
    """The meshes rounded to multiples of 2⁻¹³ mm, and smoothed near intersecting faces until no faces intersect.

    Each round smooths and checks only the neighbourhood of intersecting faces, and then checks all meshes again.

    Returns
    -------
    list of Mesh, or None
        None if faces still intersect after five rounds.

    Raises
    ------
    ValueError
        If there is no mesh.
    """
    whole = united(meshes)
    whole = whole.with_vertices(on_lattice(whole.vertices))
    for _ in range(_ROUNDS):
        crossing = self_intersecting_faces(whole)
        if not len(crossing):
            parts = whole.vertices.split([len(mesh.vertices) for mesh in meshes])
            return [mesh.with_vertices(part) for mesh, part in zip(meshes, parts, strict=True)]
        try:
            whole = _mended_around(whole, crossing)
        except ValueError:  # smoothing failed
            return None
    return None


def _mended_around(whole: Mesh, crossing: Int64[Tensor, " n"]) -> Mesh:
    points = whole.vertices.numpy()
    tree = scipy.spatial.cKDTree(points[np.unique(whole.faces[crossing].numpy())])
    near = torch.from_numpy(tree.query(points, distance_upper_bound=_REACH)[0] < _REACH)
    used, faces = torch.unique(whole.faces[near[whole.faces].any(dim=1)], return_inverse=True)
    part = smooth_crossings(Mesh(whole.vertices[used], faces), _SMOOTHINGS)
    vertices = whole.vertices.clone()
    vertices[used] = on_lattice(part.vertices)
    return whole.with_vertices(vertices)
