"""Chamfer by brute force and by a k-d tree: the same neighbours, values and gradients; bounded blocks; the door."""

import numpy as np
import pytest
import torch

import oracles
import problems
from meshot import DiscreteMeasure, chamfer
from meshot.loss.transport import nearest_neighbours


@pytest.mark.parametrize(("n", "m", "d"), [(30, 21, 3), (1, 9, 2), (9, 1, 6), (200, 300, 6)])
@pytest.mark.parametrize("dtype", [torch.float64, torch.float32])
def test_both_ways_agree_with_the_definition(n, m, d, dtype):
    source, target = problems.cloud(0, n, d, True, dtype), problems.cloud(1, m, d, True, dtype)
    arrays = (source.points.numpy(), target.points.numpy(), source.weights.numpy(), target.weights.numpy())
    gradients = []
    for neighbours in ("tree", "brute"):
        points = source.points.clone().requires_grad_()
        value = chamfer(DiscreteMeasure(points, source.weights), target, neighbours)
        assert value.dtype == dtype
        assert float(value.detach()) == pytest.approx(
            oracles.chamfer(*arrays), rel=1e-12 if dtype == torch.float64 else 1e-5
        )
        gradients += torch.autograd.grad(value, points)
    assert torch.equal(*gradients)


def test_blocks_hold_what_they_are_allowed_and_lose_nothing(monkeypatch):
    seen = []

    def recorded(points, candidates):
        seen.append(len(points) * len(candidates))
        return torch.cdist(points, candidates)

    monkeypatch.setattr("meshot.loss.transport._BLOCK", 100)
    monkeypatch.setattr("meshot.loss.transport._distances", recorded)
    points, others = problems.cloud(0, 50, 3).points, problems.cloud(1, 30, 3).points
    assert torch.equal(nearest_neighbours(points, others, "brute"), nearest_neighbours(points, others))
    assert len(seen) == 17
    assert max(seen) <= 100


def test_brute_force_does_not_cancel():
    """Far from the origin |x|² + |y|² − 2⟨x, y⟩ has no digits left for a distance of a hundredth."""
    places = torch.from_numpy(np.random.default_rng(0).random((40, 3)) / 100 + 1e7)
    order = torch.from_numpy(np.random.default_rng(1).permutation(40))
    assert torch.equal(nearest_neighbours(places, places[order], "brute"), order.argsort())


def test_door():
    measure = problems.cloud(0, 3, 2)
    with pytest.raises(ValueError, match="neighbours is 'ball'"):
        chamfer(measure, measure, "ball")
