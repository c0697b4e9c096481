"""Registration finds a motion that was planted, and repeated scans are averaged."""

import functools

import numpy as np
import pytest
import torch
from scipy.ndimage import affine_transform, center_of_mass
from scipy.spatial.transform import Rotation

from meshot.anatomy.templates import mni152_t1
from meshot.volume import averaged_scan
from meshot.volume.registration import (
    SHAPE,
    centre_of_mass,
    place_on_grid,
    register_affine,
    register_rigid,
    standard_scan,
    with_dark_background,
)
from meshot.volume.volume import Volume, sample_volume, transform_points, volume_pyramid, voxel_sizes, voxel_to_mm
from refusals import refuses

TO_STANDARD = np.eye(4)
TO_STANDARD[:3, :3] = Rotation.from_euler("xyz", [-6, 7, 10], degrees=True).as_matrix() @ np.diag([1.06, 0.95, 1.03])
TO_STANDARD[:3, 3] = [15, -30, 22]


@functools.cache
def template(factor=4):
    """The MNI152 average in voxels of some mm."""
    return volume_pyramid(mni152_t1(), factor.bit_length())[-1]


@functools.cache
def scan(factor=4):
    """The same brain elsewhere: oblique, one axis flipped, other voxels, another contrast, noise."""
    fixed, shape = template(factor), np.array([200, 220, 200]) // factor
    affine = np.eye(4)
    affine[:3, :3] = (
        Rotation.from_euler("xyz", [8, -5, 12], degrees=True).as_matrix() @ np.diag([-1.1, 1, 1.2]) * factor
    )
    affine[:3, 3] = (np.linalg.inv(TO_STANDARD) @ [0, -18, 10, 1])[:3] - affine[:3, :3] @ (shape / 2)
    to_fixed = np.linalg.inv(fixed.affine) @ TO_STANDARD @ affine
    data = affine_transform(fixed.data, to_fixed[:3, :3], to_fixed[:3, 3], tuple(shape), order=1)
    return Volume(100 * data**0.8 + np.random.default_rng(0).normal(0, 2, data.shape), affine)


def brain_points(volume):
    return voxel_to_mm(volume, torch.from_numpy(np.argwhere(volume.data > 0.2)[::50]).double())


@pytest.mark.parametrize("quick", [False, True])
def test_finds_a_planted_motion(quick):
    points = brain_points(template())
    at_home = transform_points(np.linalg.inv(TO_STANDARD), points)
    assert (at_home - points).norm(dim=1).mean() > 40
    found = transform_points(register_affine(scan(), template(), quick=quick), at_home)
    assert (found - points).norm(dim=1).mean() < 0.5
    assert (found - points).norm(dim=1).max() < 1.0


def test_the_result_repeats():
    first, again = (register_affine(scan(8), template(8)) for _ in range(2))
    np.testing.assert_array_equal(first, again)


def test_the_standard_grid():
    standard = place_on_grid(scan(), TO_STANDARD, np.array([0.0, -18.0, 10.0]))
    assert standard.volume.data.shape == SHAPE
    np.testing.assert_allclose(voxel_sizes(standard.volume), [1.5, 208 / 144, 1.5])
    assert (standard.volume.data.min(), standard.volume.data.max()) == (0, 1)
    corners = voxel_to_mm(standard.volume, torch.tensor([[-0.5] * 3, [127.5, 143.5, 127.5]], dtype=torch.float64))
    np.testing.assert_allclose(corners, [[-96, -122, -86], [96, 86, 106]])
    # A voxel of the grid holds what the scan shows at the same place.
    values = sample_volume(scan(), standard.to_scanner(brain_points(template())))
    on_grid = sample_volume(standard.volume, brain_points(template()))
    assert np.corrcoef(values, on_grid)[0, 1] > 0.99


def test_surfaces_return_to_the_scanner():
    standard = place_on_grid(scan(), TO_STANDARD, np.zeros(3))
    points = brain_points(template()).float()
    assert (standard.to_scanner(standard.from_scanner(points)) - points).norm(dim=1).max() < 0.01
    np.testing.assert_allclose(
        standard.from_scanner(points), transform_points(TO_STANDARD, points.double()).float(), atol=1e-3
    )


def test_the_centre_of_mass_against_scipy():
    random = np.random.default_rng(0)
    affine = np.vstack([random.normal(size=(3, 4)), [0, 0, 0, 1]])
    volume = Volume(random.uniform(-1, 2, (5, 6, 7)), affine)
    middle = np.array(center_of_mass(volume.data - volume.data.min()))
    np.testing.assert_allclose(centre_of_mass(volume), affine[:3, :3] @ middle + affine[:3, 3], rtol=1e-10)
    with pytest.raises(ValueError, match=r"the volume is 3\.0 everywhere"):
        centre_of_mass(volume.with_data(np.full((5, 6, 7), 3.0)))


def test_from_scan_to_grid_at_once():
    standard = standard_scan(scan(8), template(8))
    points = brain_points(template(8))
    on_grid = sample_volume(standard.volume, points)
    assert np.corrcoef(on_grid, sample_volume(template(8), points))[0, 1] > 0.9


def test_doors():
    blank = Volume(np.full((9, 9, 9), 3.0), np.eye(4))
    refuses(r"the moving image is 3.0 everywhere", register_affine, blank, template(8))
    refuses("the fixed image", register_affine, template(8), blank)
    refuses("all over the standard grid", place_on_grid, template(8), np.eye(4), np.array([1e4, 0.0, 0.0]))


ANGLE = 0.06
MOTION = np.array(
    [[np.cos(ANGLE), -np.sin(ANGLE), 0, 3.0], [np.sin(ANGLE), np.cos(ANGLE), 0, -2.0], [0, 0, 1, 4.0], [0, 0, 0, 1]]
)


@pytest.fixture(scope="module")
def head():
    return volume_pyramid(mni152_t1(), 2)[-1]


def scanned(head: Volume, motion: np.ndarray, seed: int, gain: float = 1.0) -> Volume:
    """The head after a motion of its person, with noise, on a grid of its own."""
    grid = Volume(
        np.zeros((48, 58, 50)), np.diag([4.0, 4.0, 4.0, 1.0]) + np.pad([[-95.0], [-130], [-78], [0]], [(0, 0), (3, 0)])
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
    truth = scanned(head, np.eye(4), 0).data - np.random.default_rng(0).normal(scale=0.08, size=(48, 58, 50))
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
        whole.data[:, :, 10:], whole.affine @ np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 10.0], [0, 0, 0, 1]])
    )
    found = averaged_scan([whole, short])
    np.testing.assert_allclose(found.data[:, :, :9], whole.data[:, :, :9], rtol=1e-6)
    assert np.isfinite(found.data).all()


def test_scans_that_do_not_agree_are_refused(head):
    first = scanned(head, np.eye(4), 1)
    inverted = first.with_data(np.where(first.data > 0.2, 1.2 - first.data, first.data))
    refuses("run-2 and run-1 agree poorly", averaged_scan, [first, inverted], ["run-1", "run-2"])
    refuses("no scan", averaged_scan, [])


def standardised(volume):
    """Intensities with mean 0 and deviation 1 inside the head, and a background of 0, as trained networks want them."""
    inside = volume.data > 0
    values = volume.data[inside].astype(np.float64)
    return volume.with_data(np.where(inside, (volume.data - values.mean()) / values.std(), 0).astype(np.float32))


def test_a_scan_that_was_standardised_inside_the_head_is_registered():
    fixed = mni152_t1()
    found = register_affine(standardised(fixed), fixed, quick=True)
    corners = np.array([[x, y, z, 1.0] for x in (-70, 70) for y in (-100, 70) for z in (-40, 80)])
    assert np.abs(corners @ found.T - corners)[:, :3].max() < 0.5
    assert with_dark_background(standardised(fixed)).data[0, 0, 0] < -2


def test_a_filling_value_is_replaced_by_the_lowest_other():
    fixed = mni152_t1()
    for region in (np.s_[:3], np.s_[:, :, -20:], np.s_[5:8, 6, 7]):
        filled = fixed.data.copy()
        filled[region] = -1024
        mended = with_dark_background(fixed.with_data(filled)).data
        assert mended.min() == 0
        np.testing.assert_array_equal(mended[filled > -1024], fixed.data[filled > -1024])
    outside = np.where(fixed.data > 0, fixed.data, -1000)  # most of the border, but below zero
    assert with_dark_background(fixed.with_data(outside)).data.min() == fixed.data[fixed.data > 0].min()


def test_other_scans_keep_their_values():
    fixed = mni152_t1()
    ringing = fixed.data - 0.03 * fixed.data.max() * (np.indices(fixed.data.shape).sum(axis=0) % 97 == 0)
    bright = np.where(fixed.data > 0, fixed.data + 1000, 0)  # a gap above the background
    noise = fixed.data + np.random.default_rng(0).normal(size=fixed.data.shape)
    for data in (fixed.data, ringing, bright, noise, np.full((4, 4, 4), 7.0)):
        volume = Volume(data, np.eye(4))
        assert with_dark_background(volume) is volume
