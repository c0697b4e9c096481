"""Self-intersections: planted ones, neighbours that are none, and CGAL as the oracle."""

import igl.copyleft.cgal
import numpy as np
import torch

from meshot.mesh.connectivity import self_intersecting_faces
from meshot.mesh.mesh import Mesh
from meshot.mesh.shapes import icosphere

FLAT = torch.tensor([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype=torch.float64)


def pair(other) -> Mesh:
    """The flat triangle and another one."""
    other = torch.tensor(other, dtype=torch.float64)
    return Mesh(torch.cat([FLAT, other]), torch.tensor([[0, 1, 2], [3, 4, 5]]))


def by_cgal(mesh: Mesh) -> list[int]:
    found = igl.copyleft.cgal.remesh_self_intersections(mesh.vertices.numpy(), mesh.faces.numpy(), detect_only=True)
    pairs = next(part for part in found if isinstance(part, np.ndarray) and part.ndim == 2 and part.shape[1] == 2)
    return np.unique(pairs).tolist()


def test_a_sphere_does_not_cross_itself():
    assert self_intersecting_faces(icosphere(3)).tolist() == []


def test_a_stab_through_the_middle_counts_both_faces_once():
    mesh = pair([[0.2, 0.2, -1], [0.2, 0.2, 1], [0.3, 0.9, 0]])
    assert self_intersecting_faces(mesh).tolist() == [0, 1]


def test_a_shared_edge_or_corner_is_none_even_with_doubled_vertices():
    assert self_intersecting_faces(pair([[1, 0, 0], [0, 0, 0], [0, 0, 1]])).tolist() == []
    assert self_intersecting_faces(pair([[0, 0, 0], [-1, 0, 1], [-1, 1, 1]])).tolist() == []


def test_overlap_within_a_plane_counts():
    assert self_intersecting_faces(pair([[0.1, 0.1, 0], [0.9, 0.2, 0], [0.2, 0.9, 0]])).tolist() == [0, 1]


def test_faces_apart_do_not_count():
    assert self_intersecting_faces(pair([[0, 0, 0.1], [1, 0, 0.1], [0, 1, 0.1]])).tolist() == []


def test_degenerate_faces_after_merging_are_left_out():
    mesh = Mesh(torch.zeros(3, 3, dtype=torch.float64), torch.tensor([[0, 1, 2]]))
    assert self_intersecting_faces(mesh).tolist() == []


def test_two_crossing_spheres_agree_with_cgal():
    first, second = icosphere(2), icosphere(2, centre=(0.9, 0.3, 0.1))
    mesh = Mesh(
        torch.cat([first.vertices, second.vertices]), torch.cat([first.faces, second.faces + len(first.vertices)])
    )
    found = self_intersecting_faces(mesh).tolist()
    assert len(found) > 20
    assert found == by_cgal(mesh)


def test_a_crumpled_sphere_agrees_with_cgal():
    sphere = icosphere(2)
    noise = torch.from_numpy(np.random.default_rng(0).normal(scale=0.15, size=(162, 3)))
    mesh = sphere.with_vertices(sphere.vertices + noise)
    found = self_intersecting_faces(mesh).tolist()
    assert len(found) > 5
    assert found == by_cgal(mesh)
