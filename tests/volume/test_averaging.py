"""Averages of repeated scans: the motion between them is found, and noise falls; other contrasts are refused."""

import numpy as np
import pytest

from meshot.anatomy import mni152_t1
from meshot.volume import averaged_scan
from meshot.volume.registration import register_rigid
from meshot.volume.volume import Volume, sample_volume, transform_points, volume_pyramid, voxel_to_mm

ANGLE = 0.06
MOTION = np.array(
    [[np.cos(ANGLE), -np.sin(ANGLE), 0, 3.0], [np.sin(ANGLE), np.cos(ANGLE), 0, -2.0], [0, 0, 1, 4.0], [0, 0, 0, 1]]
)


@pytest.fixture(scope="module")
def head():
    return volume_pyramid(mni152_t1(), 2)[-1]


def scanned(head: Volume, motion: np.ndarray, seed: int, gain: float = 1.0) -> Volume:
    """The head after a motion of its person, with noise, on a grid of its own."""
    import torch

    grid = Volume(
        np.zeros((66, 80, 68)), np.diag([2.9, 2.9, 2.9, 1.0]) + np.pad([[-95.0], [-130], [-78], [0]], [(0, 0), (3, 0)])
    )
    index = torch.from_numpy(np.argwhere(np.ones(grid.data.shape))).double()
    before = transform_points(np.linalg.inv(motion), voxel_to_mm(grid, index))
    values = sample_volume(head, before).numpy().reshape(grid.data.shape)
    noise = np.random.default_rng(seed).normal(scale=0.08, size=values.shape)
    return grid.with_data((gain * (values + noise)).astype(np.float32))


def test_a_planted_motion_is_found_and_is_rigid(head):
    found = register_rigid(scanned(head, MOTION, 1), scanned(head, np.eye(4), 2))
    np.testing.assert_allclose(found[:3, :3] @ found[:3, :3].T, np.eye(3), atol=1e-6)
    np.testing.assert_allclose(found, np.linalg.inv(MOTION), atol=0.5)
    np.testing.assert_allclose(found[:3, :3], np.linalg.inv(MOTION)[:3, :3], atol=0.01)


def test_the_average_has_less_noise_than_one_scan(head):
    truth = scanned(head, np.eye(4), 0).data - np.random.default_rng(0).normal(scale=0.08, size=(66, 80, 68))
    scans = [scanned(head, np.eye(4), 1), scanned(head, MOTION, 2, gain=3.0), scanned(head, np.eye(4), 3)]
    found = averaged_scan(scans)
    assert np.array_equal(found.affine, scans[0].affine)
    errors = [float(np.sqrt(((scan.data - truth) ** 2).mean())) for scan in (scans[0], found)]
    assert errors[0] == pytest.approx(0.08, rel=0.05)
    assert errors[1] < 0.75 * errors[0]


def test_a_single_scan_is_its_own_average(head):
    assert np.array_equal(averaged_scan([head]).data, head.data.astype(np.float32))


def test_where_one_scan_ends_the_others_count(head):
    whole = scanned(head, np.eye(4), 1)
    short = Volume(
        whole.data[:, :, 14:], whole.affine @ np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 14.0], [0, 0, 0, 1]])
    )
    found = averaged_scan([whole, short])
    np.testing.assert_allclose(found.data[:, :, :13], whole.data[:, :, :13], rtol=1e-6)
    assert np.isfinite(found.data).all()


def test_scans_that_do_not_agree_are_refused(head):
    first = scanned(head, np.eye(4), 1)
    inverted = first.with_data(np.where(first.data > 0.2, 1.2 - first.data, first.data))
    with pytest.raises(ValueError, match="run-2 and run-1 agree poorly"):
        averaged_scan([first, inverted], ["run-1", "run-2"])
    with pytest.raises(ValueError, match="no scan"):
        averaged_scan([])
