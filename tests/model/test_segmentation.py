"""The U-Net: shapes, folding, seeded weights, and what it refuses."""

import numpy as np
import pytest
import torch
from torch import nn

from meshot.model.segmentation import SegmentationNetwork, folded, unfolded


@pytest.mark.parametrize(("width", "depth", "fold"), [(2, 1, 1), (3, 3, 1), (4, 2, 2)])
def test_logits_lie_on_the_grid_of_the_image(width, depth, fold):
    network = SegmentationNetwork(width, depth, fold)
    image = torch.rand(2, 1, 16, 8, 24)
    logits = network(image)
    assert logits.shape == (2, 3, 16, 8, 24)
    assert torch.isfinite(logits).all()
    assert network.config() == {"width": width, "depth": depth, "fold": fold}
    assert network.multiple == fold * 2 ** (depth - 1)


def test_the_network_of_the_paper_takes_the_standard_grid_and_fits_into_ten_megabytes():
    network = SegmentationNetwork(16, 4, 2)
    n_bytes = 4 * sum(p.numel() for p in network.parameters())
    assert all(n % network.multiple == 0 for n in (128, 144, 128))
    assert n_bytes < 10e6


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
    with pytest.raises(ValueError, match=message):
        SegmentationNetwork(2, 3)(torch.zeros(shape))


@pytest.mark.parametrize("bad", [{"width": 0}, {"depth": 0}, {"fold": 1.5}])
def test_counts_must_be_positive(unchecked, bad):
    with pytest.raises(ValueError, match="integer >= 1"):
        SegmentationNetwork(**bad)
