"""Equal masses: sorted pairs give what merged quantile functions give."""

import numpy as np
import pytest
import torch

from meshot.loss.directions import random_directions
from meshot.loss.sliced import paired_cost, quantile_cost, sliced_wasserstein
from meshot.measure.discrete import DiscreteMeasure


@pytest.fixture
def clouds():
    generator = np.random.default_rng(0)
    return [torch.from_numpy(generator.normal(size=(40, 3))) for _ in range(2)]


@pytest.mark.parametrize("p", [1, 2, 3])
def test_pairs_agree_with_quantile_functions(clouds, p):
    source, target = clouds
    source.requires_grad_()
    directions = random_directions(9, 3, 0)
    weights = torch.full((40,), 1 / 40, dtype=torch.float64)
    paired = paired_cost(directions @ source.T, directions @ target.T, p)
    merged = quantile_cost(directions @ source.T, weights, directions @ target.T, weights, p)
    torch.testing.assert_close(paired, merged, rtol=1e-12, atol=1e-14)
    gradients = [torch.autograd.grad(cost.sum(), source)[0] for cost in (paired, merged)]
    torch.testing.assert_close(*gradients, rtol=1e-10, atol=1e-12)


def test_unequal_masses_are_not_paired(clouds):
    source, target = clouds
    directions = random_directions(9, 3, 0)
    heavy = torch.linspace(1, 2, 40, dtype=torch.float64)
    value = sliced_wasserstein(DiscreteMeasure(source, heavy / heavy.sum()), DiscreteMeasure(target), directions)
    equal = sliced_wasserstein(DiscreteMeasure(source), DiscreteMeasure(target), directions)
    assert abs(float(value - equal)) > 1e-4


def test_masses_that_want_a_gradient_get_one(clouds):
    source, target = clouds
    weights = torch.full((40,), 1 / 40, dtype=torch.float64, requires_grad=True)
    value = sliced_wasserstein(DiscreteMeasure(source, weights), DiscreteMeasure(target), random_directions(9, 3, 0))
    value.backward()
    assert float(weights.grad.abs().max()) > 0


@pytest.mark.parametrize("dtype", [torch.float32, torch.bfloat16])
def test_dtype_follows_the_input(clouds, dtype):
    source, target = (cloud.to(dtype) for cloud in clouds)
    assert paired_cost(source.T, target.T).dtype == dtype
