"""The cost along every direction: the mean is the loss, one is POT's, and the gradient is where it is promised."""

import numpy as np
import pytest
import torch

import problems
from meshot import random_directions, slice_costs, sliced_wasserstein, surface
from meshot.loss.sliced import plain_sliced_wasserstein
from meshot.measure.discrete import DiscreteMeasure
from meshot.mesh.shapes import icosphere

LINES = random_directions(9, 3, 0)


def measures(kind):
    solid = icosphere(1)
    continuous = surface(solid), surface(solid.with_vertices(1.3 * solid.vertices + 0.2))
    points = problems.cloud(0, 30, 3, True), problems.cloud(1, 21, 3, True)
    equal = problems.cloud(0, 30, 3), problems.cloud(1, 30, 3)
    return {
        "discrete": points,
        "equal masses": equal,
        "continuous": continuous,
        "mixed": (continuous[0], points[1]),
        "mixed, turned round": (points[0], continuous[1]),
    }[kind]


@pytest.mark.parametrize("p", [1, 2])
@pytest.mark.parametrize("kind", ["discrete", "equal masses", "continuous", "mixed", "mixed, turned round"])
def test_their_mean_is_the_loss(kind, p):
    source, target = measures(kind)
    costs = slice_costs(source, target, LINES, p)
    assert costs.shape == (9,)
    assert costs.dtype == torch.float64
    assert not costs.requires_grad
    assert float(costs.mean()) == pytest.approx(float(sliced_wasserstein(source, target, LINES, p)), rel=1e-13)
    one_by_one = [float(sliced_wasserstein(source, target, line[None], p)) for line in LINES]
    assert costs.tolist() == pytest.approx(one_by_one, rel=1e-13)


@pytest.mark.parametrize("kind", ["discrete", "equal masses"])
def test_a_gradient_that_is_wanted_is_that_of_the_plain_path(kind):
    source, target = measures(kind)
    points = source.points.clone().requires_grad_()
    moved = DiscreteMeasure(points, source.weights)
    upstream = torch.from_numpy(np.random.default_rng(0).normal(size=9))
    costs = slice_costs(moved, target, LINES)
    (found,) = torch.autograd.grad(costs @ upstream, points)
    losses = torch.stack([plain_sliced_wasserstein(moved, target, line[None]) for line in LINES])
    (expected,) = torch.autograd.grad(losses @ upstream, points)
    torch.testing.assert_close(found, expected, rtol=1e-10, atol=1e-14)
    torch.testing.assert_close(costs.detach(), slice_costs(source, target, LINES), rtol=1e-12, atol=0)
    with torch.no_grad():
        assert not slice_costs(moved, target, LINES).requires_grad


def test_with_a_continuous_measure_they_are_values():
    solid = icosphere(1)
    moving = surface(solid.with_vertices(solid.vertices.clone().requires_grad_()))
    assert not slice_costs(moving, measures("discrete")[1], LINES).requires_grad


def test_single_precision_and_doors(unchecked):
    source, target = (DiscreteMeasure(m.points.float(), m.weights.float()) for m in measures("discrete"))
    assert slice_costs(source, target, LINES).dtype == torch.float32
    with pytest.raises(ValueError, match=r"p is 0.5"):
        slice_costs(source, target, LINES, 0.5)
    with pytest.raises(ValueError, match="p is 3"):
        slice_costs(measures("continuous")[0], measures("discrete")[1], LINES, 3)
    with pytest.raises(ValueError, match="unit rows"):
        slice_costs(source, target, 2 * LINES)
    with pytest.raises(ValueError, match="same space"):
        slice_costs(source, problems.cloud(0, 3, 2, dtype=torch.float32), LINES)
