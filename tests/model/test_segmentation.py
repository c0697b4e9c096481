"""The segmentation network and its loss."""

import math

import numpy as np
import pytest
import torch
from torch import nn

from meshot.model.segmentation import SegmentationNetwork, folded, segmentation_loss, soft_dice, unfolded
from meshot.volume.volume import dice
from refusals import refuses


@pytest.mark.parametrize(("width", "depth", "fold"), [(2, 1, 1), (3, 3, 1), (4, 2, 2)])
def test_logits_lie_on_the_grid_of_the_image(width, depth, fold):
    network = SegmentationNetwork(width, depth, fold)
    image = torch.rand(2, 1, 16, 8, 24)
    logits = network(image)
    assert logits.shape == (2, 3, 16, 8, 24)
    assert torch.isfinite(logits).all()
    assert network.config() == {"width": width, "depth": depth, "fold": fold}
    assert network.multiple == fold * 2 ** (depth - 1)


def test_folding_stacks_blocks_and_is_undone():
    values = torch.arange(2 * 3 * 4 * 6 * 2.0).reshape(2, 3, 4, 6, 2)
    blocks = folded(values, 2)
    assert blocks.shape == (2, 24, 2, 3, 1)
    torch.testing.assert_close(blocks[1, 8:16, 1, 2, 0], values[1, 1, 2:4, 4:6, :].flatten())
    assert torch.equal(unfolded(blocks, 2), values)


def test_the_network_is_what_its_picture_says():
    """Two levels, written out by hand from the same weights."""
    network = SegmentationNetwork(2, 2, 1, generator=3)
    image = torch.rand(1, 1, 8, 8, 8)

    def block(layers: nn.Sequential, values: torch.Tensor) -> torch.Tensor:
        for i in (0, 3):
            values = nn.functional.conv3d(values, layers[i].weight, padding=1)
            mean, variance = values.mean((2, 3, 4), keepdim=True), values.var((2, 3, 4), keepdim=True, correction=0)
            values = ((values - mean) / (variance + 1e-5).sqrt()).clamp(min=0)
        return values

    first = block(network.down[0], image)
    second = block(network.down[1], nn.functional.max_pool3d(first, 2))
    upsampled = second.repeat_interleave(2, 2).repeat_interleave(2, 3).repeat_interleave(2, 4)
    joined = block(network.up[0], torch.cat([first, upsampled], dim=1))
    expected = nn.functional.conv3d(joined, network.head.weight, network.head.bias, padding=1)
    torch.testing.assert_close(network(image), expected, atol=1e-5, rtol=1e-4)


def test_weights_come_from_the_seed_alone():
    first, again, other = (SegmentationNetwork(4, 2, generator=seed) for seed in (0, 0, 1))
    for a, b, c in zip(first.parameters(), again.parameters(), other.parameters()):
        assert torch.equal(a, b)
        assert a.ndim < 5 or not torch.equal(a, c)
    random = np.random.default_rng(0)
    drawn = np.sqrt(2 / 27) * random.standard_normal((4, 1, 3, 3, 3))
    torch.testing.assert_close(first.down[0][0].weight.detach(), torch.from_numpy(drawn).float())


def test_the_initial_variance_is_kept():
    weight = SegmentationNetwork(16, 2).down[1][3].weight
    assert float(weight.detach().var()) == pytest.approx(2 / (27 * 32), rel=0.05)


def test_gradients_reach_every_weight():
    network = SegmentationNetwork(2, 3, 1)
    network(torch.rand(1, 1, 8, 8, 16)).square().sum().backward()
    assert all(float(p.grad.abs().max()) > 0 for p in network.parameters())


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        ((1, 1, 8, 8, 6), "multiple of 4"),
        ((1, 2, 8, 8, 8), r"\(batch, 1, x, y, z\)"),
        ((1, 8, 8, 8), r"\(batch, 1, x, y, z\)"),
        ((1, 1, 4, 4, 4), "longer than that"),
    ],
)
def test_images_of_other_sizes_are_refused(unchecked, shape, message):
    refuses(message, SegmentationNetwork(2, 3), torch.zeros(shape))


@pytest.mark.parametrize("bad", [{"width": 0}, {"depth": 0}, {"fold": 1.5}])
def test_counts_must_be_positive(unchecked, bad):
    refuses("integer >= 1", SegmentationNetwork, **bad)


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
    refuses("must agree", segmentation_loss, torch.zeros(1, 3, 2, 2, 2), torch.zeros(1, 2, 2, 2, 3))
    refuses("must agree", soft_dice, torch.zeros(1, 2), torch.zeros(2, 2))
    refuses("dice_weight is -1", segmentation_loss, torch.zeros(1, 3, 2, 2, 2), torch.zeros(1, 2, 2, 2, 2), -1)
