"""Overlap and cross-entropy against closed forms and slow twins."""

import math

import numpy as np
import pytest
import torch

from meshot.model.segmentation import segmentation_loss, soft_dice
from meshot.volume.volume import dice


def test_dice_of_two_boxes():
    first, second = torch.zeros(1, 10, 4, 4), torch.zeros(1, 10, 4, 4)
    first[0, :6], second[0, 3:] = 1, 1
    assert float(soft_dice(first, second)) == pytest.approx(2 * 3 / (6 + 7))


def test_dice_of_masks_is_the_dice_coefficient():
    masks = torch.from_numpy(np.random.default_rng(0).random((2, 3, 5, 5, 5)) > 0.6)
    found = soft_dice(*masks.double())
    for channel in range(3):
        assert float(found[channel]) == pytest.approx(dice(*masks[:, channel].numpy()))


def test_dice_is_one_where_both_are_equal_partial_volume_included():
    half = torch.full((2, 3, 3, 3), 0.5)
    assert soft_dice(half, half).tolist() == [1, 1]
    assert float(soft_dice(half, half.round())[0]) < 1
    assert soft_dice(torch.zeros(1, 2, 2, 2), torch.zeros(1, 2, 2, 2)).tolist() == [1]


def slow_loss(logits: torch.Tensor, fractions: torch.Tensor, weight: float) -> float:
    """The definition, voxel by voxel."""
    (n, _, *shape), total = logits.shape, 0.0
    shared, sizes, n_voxels = [0.0, 0.0], [0.0, 0.0], n * math.prod(shape)
    for b in range(n):
        for place in torch.cartesian_prod(*(torch.arange(k) for k in shape)).tolist():
            values = logits[(b, slice(None), *place)].tolist()
            scale = sum(math.exp(v) for v in values)
            p = [math.exp(v) / scale for v in values]
            left, right = fractions[(b, slice(None), *place)].tolist()
            total -= sum(t * math.log(q) for t, q in zip((1 - left - right, left, right), p)) / n_voxels
            for side, t in enumerate((left, right)):
                shared[side] += p[side + 1] * t
                sizes[side] += p[side + 1] ** 2 + t**2
    return total + weight * (1 - sum(2 * a / b for a, b in zip(shared, sizes)) / 2)


@pytest.mark.parametrize("weight", [0.0, 1.0, 2.5])
def test_the_loss_is_its_definition(weight):
    random = torch.Generator().manual_seed(1)
    logits = 3 * torch.randn(2, 3, 3, 2, 4, generator=random, dtype=torch.float64)
    fractions = torch.rand(2, 2, 3, 2, 4, generator=random, dtype=torch.float64) / 2
    found = segmentation_loss(logits, fractions, weight)
    assert float(found) == pytest.approx(slow_loss(logits, fractions, weight), rel=1e-12)


def test_the_loss_is_least_at_the_fractions():
    fractions = torch.tensor([[0.3, 0.6, 0.05], [0.2, 0.1, 0.9]], dtype=torch.float64).reshape(1, 2, 3, 1, 1)
    truth = torch.cat([1 - fractions.sum(1, keepdim=True), fractions], dim=1)
    logits = truth.log().requires_grad_()
    least = segmentation_loss(logits, fractions)
    least.backward()
    assert float(logits.grad.abs().max()) < 1e-12
    moved = segmentation_loss(logits.detach() + torch.tensor([0, 0.1, 0]).reshape(1, 3, 1, 1, 1), fractions)
    assert float(moved) > float(least.detach())


def test_gradients():
    logits = torch.linspace(-2, 3, 24, dtype=torch.float64).reshape(1, 3, 2, 2, 2).requires_grad_()
    fractions = torch.linspace(0, 0.5, 16, dtype=torch.float64).reshape(1, 2, 2, 2, 2)
    assert torch.autograd.gradcheck(lambda x: segmentation_loss(x, fractions), logits)


def test_extreme_logits_stay_finite():
    logits = torch.tensor([1000.0, -1000.0, 0.0]).reshape(1, 3, 1, 1, 1).requires_grad_()
    loss = segmentation_loss(logits, torch.tensor([1.0, 0.0]).reshape(1, 2, 1, 1, 1))
    loss.backward()
    assert float(loss.detach()) == pytest.approx(2000 + 0.5, rel=1e-3)
    assert torch.isfinite(logits.grad).all()


def test_other_shapes_and_weights_are_refused(unchecked):
    with pytest.raises(ValueError, match="must agree"):
        segmentation_loss(torch.zeros(1, 3, 2, 2, 2), torch.zeros(1, 2, 2, 2, 3))
    with pytest.raises(ValueError, match="must agree"):
        soft_dice(torch.zeros(1, 2), torch.zeros(2, 2))
    with pytest.raises(ValueError, match="dice_weight is -1"):
        segmentation_loss(torch.zeros(1, 3, 2, 2, 2), torch.zeros(1, 2, 2, 2, 2), -1)
