"""Volumes: the door, the affine, values between voxels."""

import numpy as np
import pytest
import torch

from affines import FLIPPED, OBLIQUE
from meshot.volume.volume import (
    Volume,
    centre_ras,
    cropped,
    mm_to_voxel,
    resample,
    sample_volume,
    transform_points,
    voxel_sizes,
    voxel_to_mm,
)
from refusals import refuses


@pytest.fixture
def ramp() -> Volume:
    """A function linear in mm on an oblique grid: trilinear interpolation must return it exactly."""
    grid = np.stack(np.meshgrid(*map(np.arange, (8, 9, 10)), indexing="ij"), axis=-1)
    places = grid @ OBLIQUE[:3, :3].T + OBLIQUE[:3, 3]
    return Volume(places @ [1.0, -2.0, 0.5] + 3, OBLIQUE)


@pytest.mark.parametrize(
    ("data", "affine", "words"),
    [
        (np.zeros((3, 3)), np.eye(4), "three axes"),
        (np.zeros((3, 3, 3, 2)), np.eye(4), "three axes"),
        (np.zeros((3, 0, 3)), np.eye(4), "empty"),
        (np.full((2, 2, 2), np.nan), np.eye(4), "8 voxels that are NaN"),
        (np.array([[["a"]]]), np.eye(4), "real numbers"),
        (np.zeros((2, 2, 2)), np.eye(3), "4 × 4"),
        (np.zeros((2, 2, 2)), np.full((4, 4), np.nan), "not finite"),
        (np.zeros((2, 2, 2)), np.diag([1.0, 1, 0, 1]), "singular"),
        (np.zeros((2, 2, 2)), np.array([[1.0, 1, 0, 0], [1, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]), "singular"),
        (np.zeros((2, 2, 2)), np.eye(4) + np.eye(4, k=-3), "transposed"),
    ],
)
def test_the_door(data, affine, words):
    refuses(words, Volume, data, affine)


def test_other_data_must_fit_the_grid():
    refuses("one value for each voxel", Volume(np.zeros((2, 2, 2)), np.eye(4)).with_data, np.zeros((2, 2, 3)))


def test_there_and_back_through_an_oblique_affine(ramp):
    points = torch.from_numpy(np.random.default_rng(0).uniform(-5, 15, size=(20, 3)))
    torch.testing.assert_close(mm_to_voxel(ramp, voxel_to_mm(ramp, points)), points)
    assert transform_points(OBLIQUE, torch.zeros(1, 3, dtype=torch.float64)).tolist() == [[-10, 5, 7]]


def test_sizes_and_centre():
    volume = Volume(np.zeros((10, 20, 30)), FLIPPED)
    assert voxel_sizes(volume).tolist() == [1, 1, 2]
    assert centre_ras(volume) == (25, 6, 31)


def test_sampling_is_exact_for_a_linear_function(ramp):
    inside = torch.from_numpy(np.random.default_rng(1).uniform(0, 7, size=(50, 3)))
    points = voxel_to_mm(ramp, inside)
    torch.testing.assert_close(sample_volume(ramp, points), points @ points.new_tensor([1.0, -2.0, 0.5]) + 3)


def test_sampling_gives_the_voxels_themselves_and_the_outside_value(ramp):
    corners = torch.tensor([[0.0, 0, 0], [7, 8, 9], [2, 3, 4], [-1, 4, 4], [-50, 0, 0], [7, 8, 60]]).double()
    values = sample_volume(ramp, voxel_to_mm(ramp, corners), outside=-7.0)
    np.testing.assert_allclose(
        values.numpy(), [ramp.data[0, 0, 0], ramp.data[7, 8, 9], ramp.data[2, 3, 4], -7, -7, -7], atol=1e-9
    )


def test_the_gradient_in_the_points(ramp):
    points = voxel_to_mm(ramp, torch.rand(5, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(0)) * 7)
    volume = ramp.with_data(np.sin(ramp.data))
    torch.autograd.gradcheck(lambda p: sample_volume(volume, p), points.requires_grad_())


def test_cropping_leaves_everything_in_place(ramp):
    points = voxel_to_mm(ramp, torch.tensor([[3.2, 4.5, 5.5], [4.9, 4.9, 5.9]]).double())
    box = cropped(ramp, points, margin=1)
    assert box.data.shape == (5, 4, 4)
    torch.testing.assert_close(sample_volume(box, points), sample_volume(ramp, points))
    refuses("do not overlap", cropped, ramp, points + 500)


@pytest.mark.parametrize("order", [1, 3])
def test_a_linear_function_is_resampled_exactly(ramp, order):
    grid = OBLIQUE @ np.diag([0.5, 0.4, 0.3, 1.0])
    grid[:3, 3] = voxel_to_mm(ramp, torch.tensor([[3.0, 4.0, 4.0]], dtype=torch.float64))[0]
    shift = np.eye(4)
    shift[:3, 3] = [0.4, -0.3, 0.2]
    places = np.moveaxis(np.indices((3, 2, 4)), 0, -1) @ grid[:3, :3].T + grid[:3, 3]
    tolerance = 1e-5 if order == 1 else 0.05  # splines of order 3 bend near the border, where the function is reflected
    for to_volume, moved in ((None, places), (shift, places + shift[:3, 3])):
        found = resample(ramp, (3, 2, 4), grid, to_volume, order)
        assert np.array_equal(found.affine, grid)
        assert found.data.dtype == (np.float32 if order == 1 else np.float64)
        np.testing.assert_allclose(found.data, moved @ [1.0, -2.0, 0.5] + 3, atol=tolerance, rtol=1e-5)


def test_the_nearest_voxel_and_what_lies_beyond_a_volume():
    volume = Volume(np.array([[[3, 5, 9]]], dtype=np.int16), np.eye(4))
    row = np.eye(4)
    row[2, 3] = -1.6

    def values(**choice) -> list:
        found = resample(volume, (1, 1, 6), row, **choice).data
        return [found.dtype, *found.ravel().tolist()]

    assert values(order=0) == [np.int16, 0, 0, 3, 5, 0, 0]
    assert values(order=0, outside="nearest") == [np.int16, 3, 3, 3, 5, 9, 9]
    assert values(order=0, outside="lowest") == [np.int16, 3, 3, 3, 5, 3, 3]
    assert values(order=1, outside=-1) == [np.float32, -1, -1, *np.float32([3.8, 6.6]).tolist(), -1, -1]
