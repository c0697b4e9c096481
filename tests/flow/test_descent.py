"""Descent against the exact heavy-ball recursion, and its stability bound."""

import numpy as np
import pytest
import torch

from meshot_book.flows import descend


def quadratic(curvature):
    return lambda points: curvature / 2 * points.square().sum()


def heavy_ball(x, curvature, n_steps, rate, momentum):
    v, path = np.zeros_like(x), [x]
    for _ in range(n_steps):
        v = momentum * v + curvature * path[-1]
        path.append(path[-1] - rate * v)
    return np.array(path)


def test_path_is_the_recursion():
    start = np.random.default_rng(0).normal(size=(5, 2))
    run = descend(quadratic(0.7), torch.from_numpy(start), 30, learning_rate=0.5, momentum=0.8, keep=range(31))
    path = heavy_ball(start, 0.7, 30, 0.5, 0.8)
    np.testing.assert_allclose(run.snapshots.numpy(), path, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(run.losses.numpy(), 0.35 * np.square(path[:-1]).sum(axis=(1, 2)), rtol=1e-12)


@pytest.mark.parametrize("momentum", [0.0, 0.5, 0.9])
@pytest.mark.parametrize(("factor", "grows"), [(0.98, False), (1.02, True)])
def test_stability_bound(momentum, factor, grows):
    curvature = 3.0
    rate = factor * 2 * (1 + momentum) / curvature
    end = descend(quadratic(curvature), torch.ones(1, 2, dtype=torch.float64), 2000, rate, momentum).points
    assert bool(end.abs().max() > 1e3) is grows
    assert bool(end.abs().max() < 1e-3) is not grows


def test_keeps_what_was_asked_for_and_leaves_the_start_alone():
    start = torch.ones(3, 2)
    run = descend(quadratic(1.0), start, 4, 0.1, keep=(2, 0))
    assert run.steps == (0, 2, 4)
    assert run.snapshots.shape == (3, 3, 2)
    assert run.snapshots.dtype == torch.float32
    assert torch.equal(run.at(0), start)
    assert torch.equal(run.points, run.at(4))
    assert torch.equal(start, torch.ones(3, 2))
    assert not run.points.requires_grad
    assert descend(quadratic(1.0), start, 2).steps == (2,)


def test_the_loss_is_called_once_a_step():
    seen = []

    def loss(points):
        seen.append(1)
        return points.sum()

    descend(loss, torch.zeros(2, 2), 7)
    assert len(seen) == 7


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"learning_rate": 0.0}, "learning_rate"),
        ({"momentum": 1.0}, "momentum"),
        ({"momentum": -0.1}, "momentum"),
        ({"keep": (11,)}, "keep asks"),
        ({"keep": (-1,)}, "keep asks"),
        ({"n_steps": 0}, "n_steps"),
        ({"learning_rate": 1e30}, "smaller learning_rate"),
    ],
)
def test_doors(settings, message):
    with pytest.raises(ValueError, match=message):
        descend(quadratic(1e10), torch.ones(2, 2), **({"n_steps": 10} | settings))


def test_unknown_moment():
    with pytest.raises(ValueError, match="kept only after"):
        descend(quadratic(1.0), torch.ones(2, 2), 3).at(1)


def test_bad_points(unchecked):
    with pytest.raises(ValueError, match="floating point"):
        descend(quadratic(1.0), torch.ones(2, 2, dtype=torch.int64))
    with pytest.raises(ValueError, match="shape"):
        descend(quadratic(1.0), torch.ones(2))
