"""The genus-0 correction against slow twins, planted defects, and every neighbourhood that matters."""

import itertools

import numpy as np
import pytest
import scipy.ndimage
import skimage.measure

from meshot.mesh.connectivity import SPHERE, topology
from meshot.volume._kernel_surfaces import is_simple, stays_well_composed
from meshot.volume.surfaces import filled_cavities, genus_zero, isosurface, largest_component
from meshot.volume.volume import Volume

N26, N6 = np.ones((3, 3, 3), bool), scipy.ndimage.generate_binary_structure(3, 1)
N18 = scipy.ndimage.generate_binary_structure(3, 2)


def slow_is_simple(cube: np.ndarray) -> bool:
    """Adding the centre changes neither the Euler number (26) nor the number of components around: by labelling."""
    around = cube.copy()
    around[1, 1, 1] = False
    _, n_object = scipy.ndimage.label(around, N26)
    labels, _ = scipy.ndimage.label(~around & N18 & ~np.pad([[[True]]], 1), N6)
    faces = [labels[p] for p in ((0, 1, 1), (2, 1, 1), (1, 0, 1), (1, 2, 1), (1, 1, 0), (1, 1, 2))]
    return n_object == 1 and len({label for label in faces if label}) == 1


def slow_is_well_composed(mask: np.ndarray) -> bool:
    """No critical configuration in any square or cube of voxels, from the definition."""
    mask = np.pad(mask, 1)
    for axis in range(3):
        others = [a for a in range(3) if a != axis]
        shifted = lambda i, j, others=others: np.roll(np.roll(mask, i, others[0]), j, others[1])  # noqa: E731
        a, b, c, d = shifted(0, 0), shifted(1, 1), shifted(0, 1), shifted(1, 0)
        if ((a & b & ~c & ~d) | (c & d & ~a & ~b)).any():
            return False
    corners = np.stack([np.roll(mask, s, (0, 1, 2)) for s in itertools.product((0, 1), repeat=3)])
    for values in (corners, ~corners):
        diagonal = [values[i] & values[7 - i] for i in range(4)]
        if ((values.sum(axis=0) == 2) & np.any(diagonal, axis=0)).any():
            return False
    return True


@pytest.fixture(scope="module")
def neighbourhoods() -> np.ndarray:
    rng = np.random.default_rng(0)
    return rng.random((1500, 3, 3, 3)) < rng.uniform(0.1, 0.9, size=(1500, 1, 1, 1))


def test_simple_points_agree_with_labelling(neighbourhoods):
    ours = [bool(is_simple(cube.ravel())) for cube in neighbourhoods]
    assert ours == [slow_is_simple(cube) for cube in neighbourhoods]
    assert 50 < sum(ours) < 1450


def test_simple_points_keep_the_euler_number(neighbourhoods):
    for cube in neighbourhoods[:300]:
        without, with_centre = cube.copy(), cube.copy()
        without[1, 1, 1], with_centre[1, 1, 1] = False, True
        if is_simple(cube.ravel()):
            numbers = [skimage.measure.euler_number(np.pad(c, 1), connectivity=3) for c in (without, with_centre)]
            assert numbers[0] == numbers[1]


def test_well_composedness_agrees_with_the_definition():
    """Grow at random: what the kernel allows stays well-composed, what it refuses would not be."""
    rng = np.random.default_rng(1)
    refused = 0
    for _ in range(40):
        cube = np.zeros((5, 5, 5), bool)
        for place in rng.permutation(np.argwhere(np.ones((3, 3, 3)))) + 1:
            i, j, k = place
            grown = cube.copy()
            grown[i, j, k] = True
            allowed = bool(stays_well_composed(cube[i - 1 : i + 2, j - 1 : j + 2, k - 1 : k + 2].ravel()))
            assert allowed == slow_is_well_composed(grown)
            refused += not allowed
            cube = grown if allowed else cube
    assert refused > 100


def checked(mask: np.ndarray, priority: np.ndarray | None = None) -> np.ndarray:
    ball = genus_zero(mask, scipy.ndimage.distance_transform_edt(mask) if priority is None else priority)
    assert not (ball & ~mask).any()
    assert slow_is_well_composed(ball)
    assert topology(isosurface(Volume(ball.astype(np.float32), np.eye(4)))) == SPHERE
    return ball


def test_a_ball_is_kept_whole():
    grid = np.indices((15, 15, 15)) - 7
    mask = (grid**2).sum(axis=0) < 30
    assert (checked(mask) == mask).all() == slow_is_well_composed(mask)


def test_a_ring_is_cut_where_the_priority_is_worst():
    mask = np.zeros((12, 12, 5), bool)
    mask[1:11, 1:11, 1:4] = True
    mask[4:8, 4:8] = False
    priority = mask.astype(float)
    priority[5:7, 1:4] = 0.1
    ball = checked(mask, priority)
    lost = np.argwhere(mask & ~ball)
    assert 0 < len(lost) <= 18
    assert priority[tuple(lost.T)].max() == pytest.approx(0.1)


def test_a_cavity_becomes_a_channel_unless_it_is_filled():
    mask = np.zeros((11, 11, 11), bool)
    mask[1:10, 1:10, 1:10] = True
    mask[5, 5, 5] = False
    assert checked(mask).sum() < mask.sum()
    assert checked(filled_cavities(mask)).sum() == 9**3


def test_noise_becomes_a_ball():
    rng = np.random.default_rng(2)
    field = scipy.ndimage.gaussian_filter(rng.normal(size=(40, 40, 40)), 1.5)
    mask = filled_cavities(largest_component(field > 0))
    before = topology(isosurface(Volume(mask.astype(np.float32), np.eye(4)))).euler_number
    assert before < -20
    assert checked(mask, field).sum() > 0.8 * mask.sum()


def test_the_largest_piece_hangs_together_by_faces():
    mask = np.zeros((6, 6, 6), bool)
    mask[0:2, 0:2, 0:2] = mask[2:5, 2:5, 2:5] = True
    assert largest_component(mask).sum() == 27


@pytest.mark.parametrize("function", [largest_component, lambda m: genus_zero(m, m.astype(float))])
def test_an_empty_mask_is_said(function):
    with pytest.raises(ValueError, match="mask is empty"):
        function(np.zeros((3, 3, 3), bool))


def test_priorities_are_checked(unchecked):
    mask = np.ones((3, 3, 3), bool)
    for bad in (np.ones((3, 3, 2)), np.full((3, 3, 3), np.inf)):
        with pytest.raises(ValueError, match="priority"):
            genus_zero(mask, bad)


def test_nothing_is_changed_in_place():
    mask = np.random.default_rng(0).random((8, 8, 8)) < 0.6
    copy, priority = mask.copy(), mask.astype(float)
    genus_zero(mask, priority)
    assert (mask == copy).all()
    assert (priority == copy).all()
