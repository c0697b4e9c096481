"""Variation between people: one age for all that ages, ranges that are kept, and unknown entries refused."""

import numpy as np
import pytest

from meshot.synth.generation import _drawn
from meshot.synth.recipe import People, drawn_person, plan, read_recipe
from meshot.synth.scanning import Position
from meshot.synth.subject import Shape


def drawn(n: int = 200, **entries: object) -> list:
    return [drawn_person(People.read(entries), Shape(), Position(), seed) for seed in range(n)]


def test_one_age_decides_thickness_atrophy_and_ventricles():
    found = drawn(thickness=[2.6, 2.1], atrophy=[0.0, 0.4], ventricles=[1.0, 2.0])
    ages = np.array([(2.6 - shape.thickness) / 0.5 for shape, _, _ in found])
    np.testing.assert_allclose([shape.atrophy for shape, _, _ in found], 0.4 * ages, atol=1e-9)
    np.testing.assert_allclose([anatomy.ventricles for _, anatomy, _ in found], 1 + ages, atol=1e-9)
    assert (ages.min() < 0.05, ages.max() > 0.95) == (True, True)


def test_everything_lies_in_its_range_and_both_halves_occur():
    found = drawn(voxel_mm=[0.8, 1.4], orientations=["RAS", "LPI"], leaf_mm=[3.0, 4.0], sulci_mm=[5.0, 9.0])
    for _, anatomy, position in found:
        assert all(0.8 <= size <= 1.4 for size in position.voxel_mm)
        assert 3 <= anatomy.leaf_mm <= 4
        assert 5 <= anatomy.sulci_mm <= 9
        assert not (anatomy.head_mm and (anatomy.blemishes.dura or anatomy.blemishes.cut))
    for what in (
        [len(set(position.voxel_mm)) == 1 for _, _, position in found],
        [bool(anatomy.head_mm) for _, anatomy, _ in found],
        [position.orientation == "RAS" for _, _, position in found],
        [shape.mirrored for shape, _, _ in found],
    ):
        assert 0.35 < np.mean(what) < 0.65


def test_the_share_of_skulls_is_kept():
    assert not any(anatomy.head_mm for _, anatomy, _ in drawn(skull_share=0.0))
    assert all(len(anatomy.head_mm) == 3 for _, anatomy, _ in drawn(skull_share=1.0))


def test_a_recess_makes_the_cortex_thicker_by_moving_its_white_surface():
    plain, moved = drawn(), drawn(recess=[0.2, 0.9])
    steps = np.array([other.thickness - one.thickness for (one, _, _), (other, _, _) in zip(plain, moved)])
    deeper = np.array([other.atrophy - one.atrophy for (one, _, _), (other, _, _) in zip(plain, moved)])
    np.testing.assert_allclose(steps, deeper, atol=1e-9)
    assert 0.2 < steps.min() < 0.3 < 0.8 < steps.max() < 0.9
    # Everything else of each person stays.
    assert [rest for _, *rest in plain] == [rest for _, *rest in moved]


@pytest.mark.parametrize(
    ("entries", "words"),
    [
        ({"ages": 3}, "people sets ages, which nothing reads"),
        ({"voxel_mm": [1.5, 0.7]}, r"voxel_mm is \[1\.5, 0\.7\]"),
        ({"voxel_mm": 1.0}, "voxel_mm is 1.0; a list of 2 is needed"),
        ({"skull_share": 2.0}, "skull_share is 2.0"),
        ({"orientations": ["XYZ"]}, "one letter"),
        ({"cut": 3.0}, "cut is 3.0"),
        ({"recess": [0.5, 0.2]}, r"recess is \[0\.5, 0\.2\]"),
        ({"recess": [-0.5, 0.2]}, r"recess is \[-0\.5, 0\.2\]"),
    ],
)
def test_entries_that_will_not_do(unchecked, entries, words):
    with pytest.raises(ValueError, match=words):
        People.read(entries, "people")


def test_a_recipe_without_people_is_drawn_as_before():
    recipe = read_recipe("oasis_like")
    shape, anatomy, position = _drawn(recipe, plan(recipe)[0])
    assert (shape.mirrored, anatomy.leaf_mm, anatomy.blemishes, position.orientation) == (None, None, None, "RAS")
    varied = read_recipe("people_like")
    assert People.read(varied.people) == People(recess=(0.1, 0.9))
    assert all(_drawn(varied, person)[1].leaf_mm for person in plan(varied)[:5])
