"""Lengths, areas, normals, volumes: a tetrahedron and a square by hand, a second library, and gradients."""

import math

import igl
import numpy as np
import pytest
import torch
import trimesh

from meshot import Mesh
from meshot.mesh import geometry
from meshot.mesh.mesh import closed_contour
from meshot.mesh.shapes import icosphere

SQUARE = closed_contour(torch.tensor([[0.0, 0], [2, 0], [2, 2], [0, 2]], dtype=torch.float64))


def tetrahedron() -> Mesh:
    vertices = torch.tensor([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=torch.float64)
    return Mesh(vertices, torch.tensor([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]))


def bumpy() -> Mesh:
    sphere = trimesh.creation.icosphere(subdivisions=2)
    vertices = sphere.vertices * (1 + 0.2 * np.random.default_rng(0).random((len(sphere.vertices), 1)))
    return Mesh(torch.from_numpy(vertices), torch.from_numpy(np.array(sphere.faces)))


def test_tetrahedron_by_hand():
    mesh = tetrahedron()
    assert torch.allclose(
        geometry.face_areas(mesh), torch.tensor([0.5, 0.5, 0.5, math.sqrt(3) / 2], dtype=torch.float64)
    )
    outward = torch.tensor([[0.0, 0, -1], [0, -1, 0], [-1, 0, 0], [3**-0.5] * 3], dtype=torch.float64)
    assert torch.allclose(geometry.face_normals(mesh), outward)
    assert float(geometry.signed_volume(mesh)) == pytest.approx(1 / 6)
    assert len(geometry.mesh_edges(mesh)) == 6
    flipped = Mesh(mesh.vertices, mesh.faces.flip(1))
    assert float(geometry.signed_volume(flipped)) == pytest.approx(-1 / 6)


def test_against_trimesh():
    mesh = bumpy()
    other = trimesh.Trimesh(mesh.vertices.numpy(), mesh.faces.numpy(), process=False)
    assert np.allclose(geometry.face_areas(mesh), other.area_faces)
    assert np.allclose(geometry.face_normals(mesh), other.face_normals)
    assert np.allclose(geometry.face_barycentres(mesh), other.triangles_center)
    assert float(geometry.signed_volume(mesh)) == pytest.approx(other.volume)
    assert np.array_equal(geometry.mesh_edges(mesh), np.unique(np.sort(other.edges_unique, axis=1), axis=0))
    assert float(geometry.edge_lengths(mesh).sum()) == pytest.approx(other.edges_unique_length.sum())


def test_vertex_areas_against_libigl():
    mesh = icosphere(2)
    mesh = mesh.with_vertices(mesh.vertices * torch.tensor([1.0, 2.0, 3.0], dtype=torch.float64))
    diagonal = igl.massmatrix(mesh.vertices.numpy(), mesh.faces.numpy(), igl.MASSMATRIX_TYPE_BARYCENTRIC).diagonal()
    np.testing.assert_allclose(geometry.vertex_areas(mesh), diagonal, rtol=1e-12)


def test_volume_does_not_depend_on_place():
    mesh = bumpy()
    far = mesh.with_vertices(mesh.vertices + 1e4)
    assert float(geometry.signed_volume(far)) == pytest.approx(float(geometry.signed_volume(mesh)), rel=1e-9)


def test_square_by_hand():
    assert torch.equal(geometry.edge_lengths(SQUARE), torch.full((4,), 2.0, dtype=torch.float64))
    assert torch.equal(geometry.edge_midpoints(SQUARE)[0], torch.tensor([1.0, 0], dtype=torch.float64))
    assert torch.equal(geometry.edge_normals(SQUARE)[0], torch.tensor([0.0, -1], dtype=torch.float64))


@pytest.mark.parametrize(
    "quantity", [geometry.face_areas, geometry.face_normals, geometry.signed_volume, geometry.edge_lengths]
)
def test_gradients(quantity):
    mesh = tetrahedron()
    vertices = mesh.vertices + 0.1 * torch.from_numpy(np.random.default_rng(1).standard_normal((4, 3)))
    assert torch.autograd.gradcheck(lambda v: quantity(mesh.with_vertices(v)), vertices.requires_grad_())


def test_a_face_without_area_gives_zeros_and_finite_gradients():
    vertices = torch.zeros(3, 3, dtype=torch.float64, requires_grad=True)
    mesh = Mesh(vertices, torch.tensor([[0, 1, 2]]))
    total = geometry.face_areas(mesh).sum() + geometry.face_normals(mesh).sum()
    total.backward()
    assert float(total.detach()) == 0
    assert torch.equal(vertices.grad, torch.zeros(3, 3, dtype=torch.float64))


def test_vertex_normals_of_a_sphere_are_radial_and_zero_where_faces_cancel():
    ball = icosphere(3, radius=5.0)
    assert float((geometry.vertex_normals(ball) * ball.vertices / 5).sum(dim=1).min()) > 0.999
    sheet = Mesh(torch.tensor([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), torch.tensor([[0, 1, 2], [0, 2, 1]]))
    assert not geometry.vertex_normals(sheet).any()
