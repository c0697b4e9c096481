"""Moments of the solid inside a mesh, against a closed form, against trimesh, and by gradcheck."""

import numpy as np
import pytest
import torch
import trimesh

from meshot.mesh.geometry import solid_moments
from meshot.mesh.mesh import Mesh
from meshot.mesh.shapes import icosphere


def box(lengths, corner):
    made = trimesh.creation.box(extents=lengths)
    vertices = torch.tensor(made.vertices.copy()) + torch.tensor(corner, dtype=torch.float64)
    return Mesh(vertices, torch.tensor(made.faces.copy()))


def test_a_box():
    volume, mean, covariance = solid_moments(box([2.0, 3.0, 4.0], [10.0, -20.0, 30.0]))
    assert float(volume) == pytest.approx(24)
    np.testing.assert_allclose(mean.numpy(), [10, -20, 30], rtol=1e-12)
    np.testing.assert_allclose(covariance.numpy(), np.diag([4, 9, 16]) / 12, atol=1e-12)


def test_an_uneven_body_as_trimesh_has_it():
    mesh = icosphere(3, 5.0, (1.0, 2.0, 3.0))
    bent = mesh.with_vertices(mesh.vertices * torch.tensor([1.0, 2.0, 0.5]) + 0.03 * mesh.vertices.square().flip(1))
    volume, mean, covariance = solid_moments(bent)
    other = trimesh.Trimesh(bent.vertices.numpy(), bent.faces.numpy(), process=False)
    assert float(volume) == pytest.approx(other.volume, rel=1e-9)
    np.testing.assert_allclose(mean.numpy(), other.center_mass, rtol=1e-9)
    inertia = other.moment_inertia / other.volume
    np.testing.assert_allclose(covariance.numpy(), np.trace(inertia) / 2 * np.eye(3) - inertia, rtol=1e-8, atol=1e-9)


def test_gradients():
    mesh = icosphere(0, 1.0, (0.3, 0.1, 0.2))
    vertices = (mesh.vertices * torch.tensor([1.0, 1.3, 0.7])).requires_grad_()
    assert torch.autograd.gradcheck(lambda v: solid_moments(mesh.with_vertices(v)), vertices)


def test_a_body_turned_inside_out_is_refused():
    mesh = icosphere(1, 1.0)
    with pytest.raises(ValueError, match="closed mesh with outward normals"):
        solid_moments(Mesh(mesh.vertices, mesh.faces.flip(1)))
