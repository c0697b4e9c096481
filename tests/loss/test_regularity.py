"""Regularisers against closed forms on regular polygons, and their gradients."""

import math

import numpy as np
import pytest
import torch

from meshot.loss.regularity import normal_inconsistency, squared_edge_length, squared_laplacian
from meshot.mesh.contours import regular_polygon, star
from meshot.mesh.mesh import Contour, Mesh, closed_contour


@pytest.mark.parametrize("n", [3, 4, 12])
def test_regular_polygon(n):
    contour = regular_polygon(n, 2.0)
    assert float(squared_edge_length(contour)) == pytest.approx((4 * math.sin(math.pi / n)) ** 2)
    # The mean of both neighbours lies on the same ray, at cos(2π/n) of the radius.
    assert float(squared_laplacian(contour)) == pytest.approx((2 * (1 - math.cos(2 * math.pi / n))) ** 2)
    assert float(normal_inconsistency(contour)) == pytest.approx(1 - math.cos(2 * math.pi / n))


def test_normals_do_not_depend_on_scale_and_see_every_turn():
    contour = star(5, 1.5, 0.35)
    assert float(normal_inconsistency(contour.with_vertices(3 * contour.vertices))) == pytest.approx(
        float(normal_inconsistency(contour))
    )
    back_and_forth = closed_contour(torch.tensor([[0.0, 0], [1, 0], [0.5, 0]]))
    assert float(normal_inconsistency(back_and_forth)) == pytest.approx(4 / 3)


def test_the_order_of_edges_does_not_matter():
    contour = star(5, 1.5, 0.35)
    shuffled = Contour(contour.vertices, contour.edges[torch.tensor(np.random.default_rng(0).permutation(10))])
    for regulariser in (squared_edge_length, squared_laplacian, normal_inconsistency):
        torch.testing.assert_close(regulariser(shuffled), regulariser(contour))


def test_tetrahedron():
    corners = torch.tensor([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], dtype=torch.float64)
    mesh = Mesh(corners, torch.tensor([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]))
    assert float(squared_edge_length(mesh)) == pytest.approx(8)
    # The three neighbours of v average to −v/3.
    assert float(squared_laplacian(mesh)) == pytest.approx((4 / 3) ** 2 * 3)


@pytest.mark.parametrize("regulariser", [squared_edge_length, squared_laplacian, normal_inconsistency])
def test_gradients(regulariser):
    generator = np.random.default_rng(0)
    vertices = star(4, 1.0, 0.5).vertices + torch.from_numpy(0.1 * generator.normal(size=(8, 2)))
    assert torch.autograd.gradcheck(lambda v: regulariser(closed_contour(v)), vertices.requires_grad_())


def test_doors():
    lonely = Contour(torch.zeros(3, 2), torch.tensor([[0, 1]]))
    with pytest.raises(ValueError, match="vertex 2 belongs to no edge"):
        squared_laplacian(lonely)
    with pytest.raises(ValueError, match="exactly one edge in"):
        normal_inconsistency(lonely)
