"""A brain mask from elsewhere leaves out what lies outside it, and nothing else."""

import numpy as np
import pytest

from meshot.volume import Volume, masked_scan
from refusals import refuses

SCAN = Volume(np.random.default_rng(0).uniform(-3, 5, (4, 5, 6)), np.diag([1.0, 2, 3, 1]))


def mask(data, affine=SCAN.affine):
    return Volume(np.asarray(data, dtype=float), affine)


def test_outside_is_the_least_value():
    inside = np.random.default_rng(1).uniform(size=SCAN.data.shape) > 0.5
    found = masked_scan(SCAN, mask(inside))
    np.testing.assert_array_equal(found.data[inside], SCAN.data[inside])
    assert set(found.data[~inside]) == {SCAN.data.min()}
    np.testing.assert_array_equal(found.affine, SCAN.affine)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (mask(np.ones((4, 5, 5))), r"has \(4, 5, 5\) voxels and the scan \(4, 5, 6\)"),
        (mask(np.eye(4)[:, [0, 1, 2, 3, 0], None] * np.ones(6), np.diag([1.5, 2, 3, 1])), "differ by up to 0.5"),
        (mask(np.zeros((4, 5, 6))), "no voxel"),
        (mask(np.ones((4, 5, 6))), "every voxel"),
    ],
    ids=["shape", "affine", "empty", "full"],
)
def test_a_mask_of_something_else_is_refused(wrong, said):
    refuses(said, masked_scan, SCAN, wrong)
