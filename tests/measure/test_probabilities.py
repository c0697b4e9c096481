"""Weights: which sums are mended, which are left alone, which are refused; and other types of float."""

import numpy as np
import pytest
import torch

from meshot import DiscreteMeasure, SurfaceMeasure, sliced_wasserstein
from meshot.mesh.shapes import cube
from meshot_book.lines import monotone_plan


def test_equal_weights_made_in_single_precision_are_taken():
    """In double precision their sum is not one, by up to 6e-8."""
    weights = torch.full((300_001,), 1 / 300_001, dtype=torch.float32)
    assert abs(float(weights.double().sum()) - 1) > 1e-9
    measure = DiscreteMeasure(torch.zeros(300_001, 3, dtype=torch.float64), weights)
    assert measure.weights.dtype == torch.float64
    assert abs(float(measure.weights.sum()) - 1) < 1e-13


@pytest.mark.parametrize("given", [torch.float16, torch.float32, torch.float64])
@pytest.mark.parametrize("wanted", [torch.float32, torch.float64])
def test_weights_get_the_type_of_the_points(given, wanted):
    weights = torch.tensor([0.25, 0.75], dtype=given)
    measure = DiscreteMeasure(torch.zeros(2, 3, dtype=wanted), weights)
    assert measure.weights.dtype == wanted
    assert measure.weights.tolist() == [0.25, 0.75]
    solid = cube().to(wanted)
    assert SurfaceMeasure(solid.vertices, solid.faces[:2], weights).weights.dtype == wanted


def test_the_loss_takes_them(unchecked):
    points = np.random.default_rng(0).normal(size=(10, 3))
    single = np.full(10, 0.1, np.float32)
    assert abs(float(single.astype(float).sum()) - 1) > 1e-9
    expected = float(sliced_wasserstein(points, points + 1))
    assert float(sliced_wasserstein(DiscreteMeasure(points, single), points + 1)) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    ("total", "taken"), [(1 + 9.8e-6, True), (1 - 9.8e-6, True), (1 + 1.02e-5, False), (1 - 1.02e-5, False)]
)
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_a_sum_near_one_is_mended_and_another_refused(total, taken, dtype):
    weights = torch.tensor([0.25, total - 0.25], dtype=dtype, requires_grad=True)
    if not taken:
        with pytest.raises(ValueError, match=r"weights sum to .*: divide by weights\.sum\(\)"):
            DiscreteMeasure(torch.zeros(2, 3, dtype=dtype), weights)
        return
    measure = DiscreteMeasure(torch.zeros(2, 3, dtype=dtype), weights)
    assert float(measure.weights.detach().sum()) == pytest.approx(1, abs=2 * torch.finfo(dtype).eps)
    (slope,) = torch.autograd.grad(measure.weights[0], weights)
    assert slope.tolist() == pytest.approx([1, 0], abs=2e-5)  # the sum counts as a constant


def test_what_rounding_leaves_is_left_alone():
    weights = torch.rand(1000, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    weights = weights / weights.sum()
    assert DiscreteMeasure(torch.zeros(1000, 3, dtype=torch.float64), weights).weights is weights


def test_a_plan_on_a_line_takes_them_too():
    line = torch.tensor([0.0, 1.0], dtype=torch.float64)
    halves = torch.tensor([0.5, 0.5 + 1e-6])
    assert float(monotone_plan(line, halves, line, halves).masses.sum()) == pytest.approx(1, abs=1e-15)
