"""Heads in the scanner: rigid motions, grids that hold what must be seen, and letters that mean what they say."""

import nibabel
import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from meshot.synth.scanning import Position, head_position, scanner_grid
from meshot.volume.volume import mm_to_voxel, voxel_sizes


def test_the_motion_is_rigid_and_within_its_bounds():
    position, centre = Position(rotation_degrees=10, translation_mm=5), np.array([0.0, -20.0, 15.0])
    for seed in range(20):
        motion = head_position(position, centre, seed)
        np.testing.assert_allclose(motion[:3, :3] @ motion[:3, :3].T, np.eye(3), atol=1e-12)
        assert np.linalg.det(motion[:3, :3]) == pytest.approx(1)
        shift = motion[:3, :3] @ centre + motion[:3, 3] - centre
        assert np.abs(shift).max() <= 5
        assert np.abs(Rotation.from_matrix(motion[:3, :3]).as_euler("xyz", degrees=True)).max() <= 10 + 1e-9
    np.testing.assert_array_equal(head_position(position, centre, 3), head_position(position, centre, 3))
    assert not np.allclose(head_position(position, centre, 3), head_position(position, centre, 4))
    still = head_position(Position(rotation_degrees=0, translation_mm=0), centre, 0)
    np.testing.assert_allclose(still, np.eye(4), atol=1e-12)


@pytest.mark.parametrize("letters", ["RAS", "LAS", "PSR", "AIL", "SRP"])
@pytest.mark.parametrize("oblique", [0.0, 15.0])
def test_the_grid_holds_everything_and_points_where_its_letters_say(letters, oblique):
    points = torch.from_numpy(np.random.default_rng(0).uniform([-60, -90, -40], [70, 70, 80], (500, 3)))
    position = Position(oblique_degrees=oblique, voxel_mm=(1.0, 1.5, 2.0), orientation=letters, margin_mm=7.0)
    grid = scanner_grid(position, points, 1)
    np.testing.assert_allclose(voxel_sizes(grid), [1.0, 1.5, 2.0], rtol=1e-6)
    places = mm_to_voxel(grid, points).numpy() * voxel_sizes(grid)
    ends = (np.array(grid.data.shape) - 1) * voxel_sizes(grid)
    assert (places > 7 - 1e-3).all()
    assert (places < ends - 7 + 1e-3).all()
    assert (places.min(axis=0) < 7 + 2.01).all()  # and not much more than that
    assert "".join(nibabel.aff2axcodes(grid.affine)) == letters
    if oblique:
        assert np.count_nonzero(np.abs(grid.affine[:3, :3]) > 1e-3) == 9
    assert (grid.affine == grid.affine.astype(np.float32)).all()  # a header keeps no more


@pytest.mark.parametrize(
    ("knobs", "words"),
    [
        ({"rotation_degrees": 45.0}, "0 to 30"),
        ({"oblique_degrees": -1.0}, "0 to 30"),
        ({"translation_mm": 1e6}, "0 to 100 mm"),
        ({"voxel_mm": (1.0, 1.0)}, "three sizes"),
        ({"voxel_mm": (1.0, 1.0, 0.0)}, "three sizes"),
        ({"margin_mm": -1.0}, "margin_mm"),
        ({"orientation": "RAP"}, "one letter of each"),
        ({"orientation": "RA"}, "one letter of each"),
        ({"orientation": "RASX"}, "one letter of each"),
    ],
)
def test_doors(unchecked, knobs, words):
    with pytest.raises(ValueError, match=words):
        Position(**knobs)
