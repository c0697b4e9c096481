"""Umbrella vectors against libigl, closed forms on spheres and planes, and what happens where there is no angle."""

import math

import igl
import numpy as np
import pytest
import torch

from meshot.mesh.geometry import cotangent_vectors, cotangents, face_areas, mean_curvatures, umbrella_vectors
from meshot.mesh.mesh import Mesh
from meshot.mesh.shapes import cube, ellipsoid, folded_sphere, icosphere, tetrahedron


def ridge() -> Mesh:
    """An open mesh: two faces that share an edge, one of them obtuse."""
    vertices = torch.tensor([[0.0, 0, 0], [2, 0, 0], [1, 2, 0.5], [1, -0.2, 0.1]], dtype=torch.float64)
    return Mesh(vertices, torch.tensor([[0, 1, 2], [1, 0, 3]]))


@pytest.mark.parametrize("mesh", [tetrahedron(), cube(), ridge(), folded_sphere(2, 40.0, 8.0)], ids=lambda m: repr(m))
def test_cotangent_vectors_agree_with_libigl(mesh):
    matrix = igl.cotmatrix(mesh.vertices.numpy(), mesh.faces.numpy())
    sums, totals = cotangent_vectors(mesh)
    np.testing.assert_allclose(sums.numpy(), matrix @ mesh.vertices.numpy(), atol=1e-10)
    np.testing.assert_allclose(totals.numpy(), -matrix.diagonal(), atol=1e-12)


def test_cotangent_vectors_are_minus_the_gradient_of_the_area():
    mesh = ellipsoid(1, (1.0, 2.0, 3.0))
    vertices = mesh.vertices.clone().requires_grad_()
    (gradient,) = torch.autograd.grad(face_areas(mesh.with_vertices(vertices)).sum(), vertices)
    torch.testing.assert_close(cotangent_vectors(mesh)[0], -gradient)


def test_angles_of_known_triangles():
    right = Mesh(torch.tensor([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), torch.tensor([[0, 1, 2]]))
    torch.testing.assert_close(cotangents(right), torch.tensor([[0.0, 1, 1]]))
    torch.testing.assert_close(cotangents(tetrahedron()), torch.full((4, 3), 1 / math.sqrt(3), dtype=torch.float64))


@pytest.mark.parametrize("radius", [0.5, 40.0])
def test_a_sphere_has_curvature_one_over_its_radius(radius):
    errors = []
    for level in (2, 3, 4):
        mesh = icosphere(level, radius)
        errors.append(float((mean_curvatures(mesh) * radius - 1).abs().mean()))
    assert errors[2] < 0.005
    assert errors[0] > 2 * errors[1] > 4 * errors[2]


def test_curvature_adds_up_to_area_over_radius_exactly():
    """Σ ⟨∇A, x⟩ = 2 A because area grows with the square of the size; on an icosahedron every ∇A is along x."""
    mesh = icosphere(0, 3.0)
    assert float(mean_curvatures(mesh).mean()) == pytest.approx(1 / 3, rel=1e-12)


def test_inside_a_plane_cotangents_see_nothing_and_the_mean_of_neighbours_does():
    """A fan around an uneven interior vertex."""
    angles = np.array([0.0, 0.7, 2.0, 3.3, 4.9])
    rim = np.stack([2 * np.cos(angles), 3 * np.sin(angles), 0 * angles], axis=1)
    vertices = torch.from_numpy(np.concatenate([[[0.3, 0.1, 0]], rim]))
    mesh = Mesh(vertices, torch.tensor([[0, k, k % 5 + 1] for k in range(1, 6)]))
    assert float(cotangent_vectors(mesh)[0][0].norm()) < 1e-12
    assert float(umbrella_vectors(mesh)[0].norm()) > 0.1


def test_a_face_without_area_has_no_angles_and_a_finite_gradient():
    vertices = torch.tensor([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [1, 1, 0]], dtype=torch.float64, requires_grad=True)
    mesh = Mesh(vertices, torch.tensor([[0, 1, 2], [0, 2, 3]]))
    assert cotangents(mesh)[0].tolist() == [0, 0, 0]
    cotangent_vectors(mesh)[0].square().sum().backward()
    assert bool(torch.isfinite(vertices.grad).all())
    alone = Mesh(vertices.detach(), torch.tensor([[0, 1, 2], [1, 0, 2]]))
    with pytest.raises(ValueError, match="vertex 3 belongs to no face"):
        mean_curvatures(alone)
    flat = Mesh(vertices.detach()[:3], torch.tensor([[0, 1, 2]]))
    assert mean_curvatures(flat).tolist() == [0, 0, 0]
