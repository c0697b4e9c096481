"""The contrast by white matter: known levels, a known bias field, and what it leaves alone."""

import numpy as np
import pytest

from meshot.anatomy.templates import GREY, WHITE, contrast_by_white_matter
from meshot.volume.volume import Volume

SHAPE = (64, 60, 62)
PLACES = np.indices(SHAPE).transpose(1, 2, 3, 0) - np.array(SHAPE) / 2
RADIUS = np.linalg.norm(PLACES, axis=-1)
INSIDE_WHITE, INSIDE_GREY = RADIUS < 18, RADIUS < 23


def ball(white: float, grey: float, air: float = 0.0) -> Volume:
    """White matter in grey matter in air, with voxels of 1.5 mm."""
    data = np.select([INSIDE_WHITE, INSIDE_GREY], [white, grey], air)
    return Volume(data.astype(np.float32), np.diag([1.5, 1.5, 1.5, 1.0]))


@pytest.mark.parametrize(("white", "grey"), [(0.9, 0.5), (0.4, 0.3), (0.6, 0.2)])
def test_both_tissues_get_their_levels(white, grey):
    found = contrast_by_white_matter(ball(white, grey), INSIDE_WHITE).data
    assert found.dtype == np.float32
    np.testing.assert_allclose(found[INSIDE_WHITE], WHITE, atol=0.005)
    np.testing.assert_allclose(found[INSIDE_GREY & ~INSIDE_WHITE], GREY, atol=0.01)
    assert np.abs(found[~INSIDE_GREY]).max() == 0


def test_the_order_of_values_is_kept_and_the_range():
    volume = ball(0.5, 0.3)
    volume.data[30, 30, 2:12] = np.linspace(0, 1, 10)  # a bright vessel in the air
    found = contrast_by_white_matter(volume, INSIDE_WHITE).data
    vessel = found[30, 30, 2:12]
    assert (np.diff(vessel) >= 0).all()
    assert (found.min(), found.max()) == (0, 1)


def test_a_bias_field_goes_away():
    smooth = np.exp(0.3 * np.sin(PLACES[..., 0] / 20 + 0.3) + 0.15 * PLACES[..., 2] / 20)
    affine = np.diag([4.0, 4.0, 4.0, 1.0])  # a ball of the size of a brain
    biased = Volume((ball(0.5, 0.3).data * smooth).astype(np.float32), affine)
    before = biased.data[INSIDE_WHITE].std() / biased.data[INSIDE_WHITE].mean()
    found = contrast_by_white_matter(biased, INSIDE_WHITE).data
    after = found[INSIDE_WHITE].std() / found[INSIDE_WHITE].mean()
    assert before > 0.1
    assert after < before / 2
    shell = INSIDE_GREY & ~INSIDE_WHITE
    assert found[shell].std() < biased.data[shell].std()
    assert np.median(found[shell]) == pytest.approx(GREY, abs=0.02)


def test_small_errors_of_the_mask_do_not_matter():
    noisy = ball(0.5, 0.3)
    noisy = noisy.with_data(noisy.data + np.random.default_rng(0).normal(0, 0.02, SHAPE).astype(np.float32))
    exact = contrast_by_white_matter(noisy, INSIDE_WHITE).data
    for radius in (17, 19):
        other = contrast_by_white_matter(noisy, radius > RADIUS).data
        assert np.abs(other - exact)[INSIDE_GREY].max() < 0.03


def test_levels_in_another_order_are_left():
    volume = ball(0.4, 0.8)  # as in a T2
    found = contrast_by_white_matter(volume, INSIDE_WHITE).data
    np.testing.assert_allclose(found[INSIDE_WHITE], WHITE, atol=0.005)
    assert (found[INSIDE_GREY & ~INSIDE_WHITE] > WHITE).all()


def test_white_matter_without_depth_is_refused():
    sheet = np.zeros(SHAPE, dtype=bool)
    sheet[30:33] = True
    with pytest.raises(ValueError, match="no voxel of the white matter lies 2 voxels inside"):
        contrast_by_white_matter(ball(0.5, 0.3), sheet)
    with pytest.raises(ValueError, match="was white matter found"):
        contrast_by_white_matter(ball(0.5, 0.3), np.zeros(SHAPE, dtype=bool))


def test_black_white_matter_is_refused():
    with pytest.raises(ValueError, match="the median of the white matter is 0"):
        contrast_by_white_matter(ball(0.0, 0.5), INSIDE_WHITE)
