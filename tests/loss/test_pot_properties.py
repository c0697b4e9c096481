"""What POT's own tests ask of sliced distances (its ``test_sliced.py``), asked of ours, beside POT's own values.

Left out: the max-sliced and spherical variants, which we do not have, and backends other than torch.
"""

import ot
import pytest
import torch

import problems
from meshot import (
    DiscreteMeasure,
    random_directions,
    sliced_wasserstein,
)
from meshot.loss.sliced import plain_sliced_wasserstein

both = pytest.mark.parametrize("loss", [sliced_wasserstein, plain_sliced_wasserstein])


def pot_distance(source, target, directions, p):
    """POT's sliced distance over the same directions (columns there), to the power p."""
    arrays = [m.points.numpy() for m in (source, target)] + [m.weights.numpy() for m in (source, target)]
    return ot.sliced_wasserstein_distance(*arrays, projections=directions.numpy().T, p=p) ** p


@both
@pytest.mark.parametrize(("m", "weighted"), [(100, False), (200, False), (200, True)])
@pytest.mark.parametrize("p", [1, 2, 3])
def test_the_value_of_pot(loss, p, m, weighted):
    source, target = problems.cloud(0, 100, 4, weighted), problems.cloud(1, m, 4, weighted)
    directions = random_directions(20, 4, 0)
    value = loss(source, target, directions, p)
    assert float(value) == pytest.approx(pot_distance(source, target, directions, p), rel=1e-10)
    assert float(value) > 0


@both
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_type_and_device_follow_the_input(loss, dtype):
    source, target = problems.cloud(0, 100, 2, dtype=dtype), problems.cloud(1, 200, 2, dtype=dtype)
    value = loss(source, target, random_directions(20, 2, 0, dtype))
    assert value.dtype == dtype
    assert value.device == source.points.device
    exact = [
        DiscreteMeasure(m.points.double(), m.weights.double() / m.weights.double().sum()) for m in (source, target)
    ]
    expected = pot_distance(*exact, random_directions(20, 2, 0), 2)
    assert float(value) == pytest.approx(expected, rel={torch.float32: 1e-4, torch.float64: 1e-10}[dtype])


@both
@pytest.mark.parametrize("p", [1, 2, 3])
@pytest.mark.parametrize("weighted", [True, False])
def test_gradients_of_pot(loss, p, weighted):
    """Where POT differentiates by torch, ours agrees, in points of equal and of unequal masses."""
    directions, found = random_directions(15, 3, 0), []
    clouds = problems.cloud(0, 30, 3, weighted), problems.cloud(1, 30, 3, weighted)

    def by_pot(source, target):
        points = source.points, target.points, source.weights, target.weights
        return ot.sliced_wasserstein_distance(*points, projections=directions.T.contiguous(), p=p) ** p

    for compute in (lambda *pair: loss(*pair, directions, p), by_pot):
        points = [m.points.clone().requires_grad_() for m in clouds]
        value = compute(*(DiscreteMeasure(x, m.weights) for x, m in zip(points, clouds, strict=True)))
        found.append(torch.autograd.grad(value, points))
    for ours, theirs in zip(*found, strict=True):
        assert bool(torch.isfinite(ours).all())
        torch.testing.assert_close(ours, theirs, rtol=1e-9, atol=1e-12)


@both
def test_gradients_are_finite_where_measures_agree(loss):
    points = problems.cloud(0, 20, 3).points.requires_grad_()
    for p in (1, 1.5, 2, 3):
        value = loss(DiscreteMeasure(points), DiscreteMeasure(points.detach().clone()), random_directions(9, 3, 0), p)
        (gradient,) = torch.autograd.grad(value, points)
        assert float(gradient.abs().max()) == 0
