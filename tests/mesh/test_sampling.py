"""Samples: where they lie, how often each face is hit, and what moves with the vertices."""

import math

import numpy as np
import pytest
import torch
from scipy import stats

from meshot import Mesh
from meshot.mesh.geometry import even_points, face_areas, sample_locations, sample_points
from meshot.mesh.mesh import Contour, closed_contour

SQUARE = closed_contour(torch.tensor([[0.0, 0], [2, 0], [2, 2], [0, 2]], dtype=torch.float64))


def uneven_mesh() -> Mesh:
    """A fan of faces with areas from zero (the first and the last) to large."""
    x = torch.tensor([0.0, 0.0, 1.0, 3.0, 3.5, 8.0, 8.0], dtype=torch.float64)
    rim = torch.stack([x, torch.zeros_like(x), torch.zeros_like(x)], dim=1)
    apex = torch.tensor([[2.0, 1, 1]], dtype=torch.float64)
    first = torch.arange(6)
    return Mesh(torch.cat([rim, apex]), torch.stack([first, first + 1, torch.full((6,), 7)], dim=1))


def test_faces_are_hit_by_area():
    mesh = uneven_mesh()
    cells, barycentric = sample_locations(mesh, 20_000, 0)
    areas = face_areas(mesh)
    counts = np.bincount(cells.numpy(), minlength=len(areas))
    expected = (areas / areas.sum() * 20_000).numpy()
    assert counts[expected == 0].sum() == 0
    positive = expected > 0
    assert stats.chisquare(counts[positive], expected[positive]).pvalue > 0.01
    assert torch.allclose(barycentric.sum(dim=1), torch.ones(20_000, dtype=torch.float64))
    assert float(barycentric.min()) >= 0


def test_points_are_uniform_on_a_triangle():
    triangle = Mesh(torch.eye(3, dtype=torch.float64), torch.tensor([[0, 1, 2]]))
    barycentric = sample_points(triangle, 20_000, 1)
    # Each barycentric coordinate of a uniform point has the Beta(1, 2) law.
    for coordinate in barycentric.T:
        assert stats.kstest(coordinate.numpy(), stats.beta(1, 2).cdf).pvalue > 0.01


def test_points_are_uniform_on_a_contour():
    points = sample_points(SQUARE, 20_000, 2)
    on_edge = (points == 0) | (points == 2)
    assert bool(on_edge.any(dim=1).all())
    bottom = points[points[:, 1] == 0][:, 0]
    assert stats.kstest(bottom.numpy(), stats.uniform(0, 2).cdf).pvalue > 0.01


def test_a_seed_repeats_and_points_follow_the_vertices():
    mesh = uneven_mesh()
    assert torch.equal(sample_points(mesh, 50, 3), sample_points(mesh, 50, 3))
    moved = mesh.with_vertices(mesh.vertices + 5)
    assert torch.allclose(sample_points(moved, 50, 3), sample_points(mesh, 50, 3) + 5)
    vertices = mesh.vertices.clone().requires_grad_()
    sample_points(mesh.with_vertices(vertices), 50, 3).sum().backward()
    assert float(vertices.grad.sum()) == pytest.approx(150)


def test_even_points_are_even():
    points = even_points(SQUARE, 16)
    gaps = (points - points.roll(-1, 0)).abs().sum(dim=1)
    assert torch.allclose(gaps, torch.full((16,), 0.5, dtype=torch.float64))
    assert torch.equal(even_points(SQUARE, 4, offset=0), SQUARE.vertices)


def test_even_points_skip_edges_without_length():
    vertices = torch.tensor([[0.0, 0], [0, 0], [1, 0], [0, 1]], dtype=torch.float64)
    points = even_points(closed_contour(vertices), 7)
    assert bool(torch.isfinite(points).all())


@pytest.mark.parametrize("n_points", [0, -3, 2.5])
def test_counts_are_checked(unchecked, n_points):
    with pytest.raises(ValueError, match="n_points"):
        sample_points(SQUARE, n_points, 0)
    with pytest.raises(ValueError, match="n_points"):
        even_points(SQUARE, n_points)


def test_a_shape_without_size_cannot_be_sampled():
    point = Contour(torch.ones(2, 2), torch.tensor([[0, 1]]))
    with pytest.raises(ValueError, match="positive size"):
        sample_points(point, 5, 0)
    with pytest.raises(ValueError, match="no length"):
        even_points(point, 5)
    with pytest.raises(ValueError, match=r"\[0, 1\)"):
        even_points(SQUARE, 5, offset=1.0)


def test_arc_length_of_a_circle():
    angles = torch.arange(400, dtype=torch.float64) * (2 * math.pi / 400)
    circle = closed_contour(torch.stack([angles.cos(), angles.sin()], dim=1))
    points = even_points(circle, 100)
    assert float(points.norm(dim=1).min()) > 0.9999
    assert float(points.mean(dim=0).abs().max()) < 1e-12
