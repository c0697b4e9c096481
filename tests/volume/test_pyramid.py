"""Volumes at several scales: means of blocks, each at its place."""

import numpy as np
import pytest

from affines import OBLIQUE
from meshot.volume.volume import Volume, volume_pyramid
from refusals import refuses


def test_every_level_is_the_mean_of_eight_voxels_of_the_one_before():
    data = np.random.default_rng(0).random((8, 12, 4))
    levels = volume_pyramid(Volume(data, np.eye(4)), 3)
    assert [level.data.shape for level in levels] == [(8, 12, 4), (4, 6, 2), (2, 3, 1)]
    assert levels[1].data[1, 2, 0] == pytest.approx(data[2:4, 4:6, 0:2].mean(), rel=1e-12)
    assert levels[2].data[1, 1, 0] == pytest.approx(data[4:8, 4:8, 0:4].mean(), rel=1e-12)


def test_a_function_linear_in_mm_stays_the_same_function():
    def ramp(affine: np.ndarray, shape: tuple) -> np.ndarray:
        grid = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1)
        return (grid @ affine[:3, :3].T + affine[:3, 3]) @ [1.0, -2.0, 0.5] + 3

    for level in volume_pyramid(Volume(ramp(OBLIQUE, (8, 8, 16)), OBLIQUE), 3):
        np.testing.assert_allclose(level.data, ramp(level.affine, level.data.shape), rtol=0, atol=1e-12)


def test_odd_axes_are_filled_up_with_zeros_and_whole_numbers_become_fractions():
    level = volume_pyramid(Volume(np.ones((3, 2, 2), dtype=np.int16), np.eye(4)), 2)[1]
    np.testing.assert_array_equal(level.data[:, 0, 0], [1.0, 0.5])


def test_at_least_one_level_is_needed():
    refuses("n_scales is 0", volume_pyramid, Volume(np.ones((2, 2, 2)), np.eye(4)), 0)
