"""Tissue from intensity on images whose classes are known."""

import numpy as np
import pytest

from meshot.volume.volume import Volume, dice, white_matter_probability
from refusals import refuses


@pytest.fixture
def slabs() -> tuple[Volume, Volume]:
    """Air, fluid, grey and white side by side, with a little noise and a ramp between grey and white."""
    profile = np.concatenate(
        [np.zeros(5), np.full(10, 20.0), np.full(20, 60.0), np.linspace(60, 100, 9), np.full(20, 100.0)]
    )
    data = np.broadcast_to(profile[:, None, None], (len(profile), 12, 12))
    noise = np.random.default_rng(0).normal(scale=1.0, size=data.shape)
    return Volume(data + noise * (data > 0), np.eye(4)), Volume(data > 0, np.eye(4))


def test_white_is_one_grey_is_zero_and_the_middle_between(slabs):
    probability = white_matter_probability(*slabs)
    mean = probability.data.mean(axis=(1, 2))
    assert mean[:5].max() == 0
    assert mean[5:35].max() < 0.06
    assert mean[46:].min() > 0.9
    assert np.all(np.diff(mean[36:43]) > 0)
    assert 38 <= np.argmax(mean > 0.5) <= 41


def test_the_scale_of_intensities_does_not_matter(slabs):
    t1, brain = slabs
    other = white_matter_probability(t1.with_data(7 * t1.data + 3), brain)
    np.testing.assert_allclose(other.data, white_matter_probability(t1, brain).data, atol=1e-4)


def test_what_cannot_be_told_is_said(slabs):
    t1, brain = slabs
    refuses("share one grid", white_matter_probability, t1, Volume(brain.data, np.diag([2.0, 1, 1, 1])))
    for bad in (np.zeros_like(brain.data), t1.data == t1.data.max()):
        with pytest.raises(ValueError, match="fewer than three"):
            white_matter_probability(t1, brain.with_data(bad))


def test_dice_by_hand():
    first, second = np.array([1, 1, 1, 0]), np.array([0, 1, 1, 0])
    assert dice(first, second) == pytest.approx(0.8)
    refuses("not both empty", dice, np.zeros(3), np.zeros(3))
    refuses("one shape", dice, np.ones(3), np.ones(4))
