"""Ellipsoids in a head: their volume, where they are cut off, and how they move."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from meshot.mesh.shapes import icosphere
from meshot.synth.imaging import DEPTH_MM, Structure, add_structures, moved_structure, structure_fraction, structures_of
from meshot.volume.volume import Volume

GRID = Volume(np.zeros((60, 56, 50)), np.array([[-1.0, 0, 0, 30], [0, 1, 0, -28], [0, 0, 1.2, -30], [0, 0, 0, 1]]))
TURN = np.eye(4)
TURN[:3, :3] = Rotation.from_euler("xyz", [20, -30, 40], degrees=True).as_matrix()
TURN[:3, 3] = [3.0, -2.0, 4.0]


def places():
    index = np.stack(np.meshgrid(*map(np.arange, GRID.data.shape), indexing="ij"), axis=-1)
    return index @ GRID.affine[:3, :3].T + GRID.affine[:3, 3]


def test_an_ellipsoid_has_its_volume_and_its_place():
    upright = Structure("fluid", np.zeros(3), np.diag([6.0, 9.0, 12.0]), True)
    for structure in (upright, moved_structure(upright, TURN)):
        box, part = structure_fraction(structure, GRID)
        assert part.sum() * 1.2 == pytest.approx(4 / 3 * np.pi * 6 * 9 * 12, rel=0.02)
        inside = np.linalg.norm((places()[box] - structure.centre_mm) @ np.linalg.inv(structure.axes_mm).T, axis=-1) < 1
        assert (part[inside] > 0.5 - 1e-9).all()
        assert (part[~inside] < 0.5 + 1e-9).all()
    np.testing.assert_allclose(moved_structure(upright, TURN).centre_mm, TURN[:3, 3])


def test_an_ellipsoid_beyond_the_grid_fills_nothing():
    box, part = structure_fraction(Structure("fluid", np.full(3, 500.0), np.eye(3), True), GRID)
    assert part.size == 0 or part.max() == 0
    assert np.zeros(GRID.data.shape)[box].shape == part.shape


def test_inner_structures_stay_below_the_surface_and_outer_ones_outside():
    radius = np.linalg.norm(places(), axis=-1)
    white, pial = (np.clip(r + 0.5 - radius, 0, 1) for r in (15.0, 18.0))
    inner = Structure("deep grey", np.array([12.0, 0, 0]), 6 * np.eye(3), True)
    outer = Structure("hindbrain", np.array([0, 0, -18.0]), 8 * np.eye(3), False)
    found = add_structures({"white": white, "grey": pial - white}, pial, GRID, [inner, outer])
    total = sum(found.values())
    np.testing.assert_allclose(total[radius < 17], 1, atol=1e-12)
    assert total.max() <= 1 + 1e-12
    deep = found["deep grey"] > 0.5
    assert deep.any()
    assert radius[deep].max() < 15 - DEPTH_MM + 1.5
    assert radius[found["hindbrain"] > 0.5].min() > 17.4
    assert found["hindbrain"].sum() > 0


def test_later_structures_replace_earlier_ones():
    white = np.ones(GRID.data.shape)
    first, second = (Structure(t, np.zeros(3), r * np.eye(3), True) for t, r in (("deep grey", 8), ("fluid", 4)))
    found = add_structures({"white": white, "grey": 0 * white}, white, GRID, [first, second])
    middle = np.linalg.norm(places(), axis=-1) < 3
    assert (found["fluid"][middle] == 1).all()
    assert (found["deep grey"][middle] == 0).all()


def test_both_sides_are_mirror_images_and_multiples_scale():
    white = {"left": icosphere(2, 30.0, (-31.0, 0, 0)), "right": icosphere(2, 30.0, (31.0, 0, 0))}
    left, right = structures_of(white)[:2]
    np.testing.assert_allclose(left.centre_mm * [-1, 1, 1], right.centre_mm, atol=1e-9)
    assert left.centre_mm[0] > -31  # nearer to the middle of the head than the middle of its hemisphere

    def ventricles(scale):
        return sum(np.linalg.det(s.axes_mm) for s in structures_of(white, ventricles=scale) if s.tissue == "fluid")

    assert ventricles(2.0) == pytest.approx(8 * ventricles(1.0))
    assert ventricles(0.0) == 0
    assert all(s.inside_white for s in structures_of(white, below=0.0))


def test_doors():
    with pytest.raises(ValueError, match="multiples from 0"):
        structures_of({"left": icosphere(1)}, ventricles=-1.0)
    with pytest.raises(ValueError, match="multiples from 0"):
        structures_of({"left": icosphere(1)}, below=4.0)
