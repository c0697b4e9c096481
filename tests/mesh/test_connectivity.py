"""Topology against shapes with known counts, and self-intersections against CGAL."""

import igl.copyleft.cgal
import numpy as np
import pytest
import torch
import trimesh

from meshot.mesh import united
from meshot.mesh.connectivity import (
    SPHERE,
    boundary_edges,
    component_labels,
    euler_number,
    is_consistently_oriented,
    nonmanifold_edges,
    self_intersecting_faces,
    topology,
)
from meshot.mesh.mesh import Mesh
from meshot.mesh.shapes import icosphere


def test_a_sphere_is_a_sphere():
    assert topology(icosphere(2)) == SPHERE


def test_a_torus_has_euler_number_zero_and_is_no_sphere():
    mesh = Mesh.from_trimesh(trimesh.creation.torus(3.0, 1.0))
    assert euler_number(mesh) == 0
    assert topology(mesh) != SPHERE


def test_two_spheres_have_two_pieces_and_euler_number_four():
    found = topology(united([icosphere(1), icosphere(1, centre=(5, 0, 0))]))
    assert (found.euler_number, found.n_components) == (4, 2)


def test_labels_number_the_pieces_per_face():
    labels = component_labels(united([icosphere(0), icosphere(1, centre=(5, 0, 0))]))
    assert labels.tolist() == [0] * 20 + [1] * 80


def test_a_missing_face_leaves_its_three_edges_open():
    sphere = icosphere(1)
    mesh = Mesh(sphere.vertices, sphere.faces[1:])
    assert {tuple(e) for e in boundary_edges(mesh).tolist()} == {
        tuple(sorted(pair)) for pair in zip(sphere.faces[0].tolist(), sphere.faces[0].roll(1).tolist(), strict=True)
    }
    assert euler_number(mesh) == 1


def test_three_faces_on_one_edge_are_not_manifold():
    vertices = torch.tensor([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1]])
    mesh = Mesh(vertices, torch.tensor([[0, 1, 2], [1, 0, 3], [0, 1, 4]]))
    assert nonmanifold_edges(mesh).tolist() == [[0, 1]]
    assert not is_consistently_oriented(mesh)


def test_a_face_turned_round_is_seen():
    sphere = icosphere(1)
    faces = sphere.faces.clone()
    faces[3] = faces[3].flip(0)
    assert is_consistently_oriented(sphere)
    assert not is_consistently_oriented(Mesh(sphere.vertices, faces))


def test_vertices_without_a_face_do_not_count():
    sphere = icosphere(1)
    assert euler_number(Mesh(torch.cat([sphere.vertices, sphere.vertices[:7]]), sphere.faces)) == 2


FLAT = torch.tensor([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype=torch.float64)


def by_cgal(mesh: Mesh) -> list[int]:
    found = igl.copyleft.cgal.remesh_self_intersections(mesh.vertices.numpy(), mesh.faces.numpy(), detect_only=True)
    pairs = next(part for part in found if isinstance(part, np.ndarray) and part.ndim == 2 and part.shape[1] == 2)
    return np.unique(pairs).tolist()


@pytest.mark.parametrize(
    ("other", "crosses"),
    [
        ([[0.2, 0.2, -1], [0.2, 0.2, 1], [0.3, 0.9, 0]], True),  # a stab through the middle counts both faces once
        ([[0.1, 0.1, 0], [0.9, 0.2, 0], [0.2, 0.9, 0]], True),  # overlap within a plane
        ([[1, 0, 0], [0, 0, 0], [0, 0, 1]], False),  # a shared edge, with doubled vertices
        ([[0, 0, 0], [-1, 0, 1], [-1, 1, 1]], False),  # a shared corner
        ([[0, 0, 0.1], [1, 0, 0.1], [0, 1, 0.1]], False),  # apart
    ],
)
def test_two_triangles(other, crosses):
    vertices = torch.cat([FLAT, torch.tensor(other, dtype=torch.float64)])
    found = self_intersecting_faces(Mesh(vertices, torch.tensor([[0, 1, 2], [3, 4, 5]])))
    assert found.tolist() == ([0, 1] if crosses else [])


def test_a_sphere_and_a_face_that_is_a_point_do_not_cross_themselves():
    for mesh in (icosphere(3), Mesh(torch.zeros(3, 3, dtype=torch.float64), torch.tensor([[0, 1, 2]]))):
        assert self_intersecting_faces(mesh).tolist() == []


CRUMPLED = icosphere(2).with_vertices(
    icosphere(2).vertices + torch.from_numpy(np.random.default_rng(0).normal(scale=0.15, size=(162, 3)))
)


@pytest.mark.parametrize(
    ("mesh", "least"), [(united([icosphere(2), icosphere(2, centre=(0.9, 0.3, 0.1))]), 20), (CRUMPLED, 5)]
)
def test_crossing_spheres_and_a_crumpled_one_agree_with_cgal(mesh, least):
    found = self_intersecting_faces(mesh).tolist()
    assert len(found) > least
    assert found == by_cgal(mesh)
