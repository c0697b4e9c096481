"""Recipes: what is in the files, what is refused, what is drawn, and how people vary."""

import collections
import dataclasses

import numpy as np
import pytest
import yaml

from meshot.synth.generation import _drawn
from meshot.synth.recipe import (
    People,
    Recipe,
    drawn_appearance,
    drawn_person,
    drawn_position,
    drawn_shape,
    drawn_structures,
    plan,
    read_recipe,
    recipe_text,
)
from meshot.synth.scanning import Position
from meshot.synth.subject import Shape
from refusals import refuses

SIGNAL = dict.fromkeys(("white", "grey", "deep grey", "hindbrain", "fluid", "skull", "scalp"), 100.0)
LEAST = {"name": "x", "seed": 1, "appearance": {"signal": SIGNAL}}


def recipe(**entries):
    return Recipe(**LEAST | entries)


@pytest.mark.parametrize("name", ["adni_like", "oasis_like", "people_like", "test_retest", "tiny"])
def test_the_recipes_of_the_book_are_sound_and_survive_writing(tmp_path, name):
    found = read_recipe(name)
    assert found.name == name
    (tmp_path / "again.yaml").write_text(recipe_text(found), encoding="utf-8")
    assert dataclasses.asdict(read_recipe(tmp_path / "again.yaml")) == dataclasses.asdict(found)


@pytest.mark.parametrize("name", ["adni_like", "oasis_like"])
def test_the_two_cohorts_have_the_proportions_of_the_paper(name):
    people = plan(read_recipe(name))
    counts = collections.Counter((p.kind, p.split) for p in people)
    assert [counts["template", s] for s in ("train", "validation", "test")] == [28, 4, 8]
    assert {split for kind, split in counts if kind == "procedural"} == {"test"}
    assert len({p.participant_id for p in people}) == len({p.seed for p in people}) == len(people)


def test_more_subjects_leave_the_first_as_they_are():
    path = "oasis_like"
    few, many = (plan(read_recipe(path, subjects=n, procedural_subjects=0)) for n in (10, 200))
    assert many[:10] == few
    assert collections.Counter(p.split for p in many) == {"train": 140, "validation": 20, "test": 40}
    assert {p.seed for p in few}.isdisjoint(p.seed for p in plan(read_recipe(path, seed=5)))


def test_held_out_subjects_leave_all_others_as_they_are():
    before, after = (plan(read_recipe("oasis_like", held_out_subjects=n)) for n in (0, 8))
    new = [person for person in after if person not in before]
    assert [person for person in after if person in before] == before
    assert [person.participant_id for person in new] == [f"sub-h{i:02d}" for i in range(1, 9)]
    assert {(person.split, person.kind) for person in new} == {("test", "template")}
    assert collections.Counter((p.split, p.kind) for p in after)["test", "template"] == 16
    assert len({person.seed for person in after}) == len(after)
    assert sorted(after, key=lambda person: person.participant_id) == after
    assert plan(read_recipe("oasis_like", held_out_subjects=3))[40:43] == new[:3]


def test_the_paper_has_120_scans():
    from meshot.synth.generation import visits

    found = read_recipe("test_retest", days=20)
    assert len(visits(found)) * found.scans_per_day == 120
    assert {p.split for p in plan(found)} == {"test"}


def test_what_is_drawn_lies_in_its_range_and_repeats():
    made = recipe(appearance={"signal": SIGNAL | {"white": [100, 120]}, "noise": [1, 2]}, structures={"below": [0, 1]})
    drawn = [drawn_appearance(made, seed) for seed in range(50)]
    assert all(100 <= a.signal["white"] <= 120 and 1 <= a.noise <= 2 and a.signal["grey"] == 100 for a in drawn)
    assert max(a.noise for a in drawn) - min(a.noise for a in drawn) > 0.7
    assert drawn_appearance(made, 3) == drawn[3]
    extras = [drawn_structures(made, seed) for seed in range(50)]
    assert {e["ventricles"] for e in extras} == {1.0}
    assert 0 <= min(e["below"] for e in extras) < 0.2 < 0.8 < max(e["below"] for e in extras) <= 1


def test_shapes_and_positions_get_their_knobs():
    made = recipe(shape={"thickness": 2.0}, position={"voxel_mm": [1, 1, 2], "orientation": "LAS"})
    assert (drawn_shape(made, "template").kind, drawn_shape(made, "template").thickness) == ("template", 2.0)
    assert drawn_shape(made, "procedural").kind == "procedural"
    assert drawn_position(made).voxel_mm == (1, 1, 2)


@pytest.mark.parametrize(
    ("entries", "words"),
    [
        ({"subjects": -1}, "subjects is -1"),
        ({"held_out_subjects": 1.5}, r"held_out_subjects is 1\.5"),
        ({"seed": 1.5}, "seed is 1.5"),
        ({"days": 0}, "days"),
        ({"n_lines": 0}, "n_lines"),
        ({"registration_mm": 3}, "registration_mm is 3"),
        ({"standard": "magic"}, "standard is 'magic'"),
        ({"split": {"train": 0.5}}, "sum to one"),
        ({"split": {"train": 1.5, "test": -0.5}}, "sum to one"),
        ({"split": {"training": 1.0}}, "split names training"),
        ({"head_mm": (1.0, 2.0)}, "three thicknesses"),
        ({"head_mm": (1.0, 2.0, -1.0)}, "head_mm is -1.0; a finite number > 0 is needed, in mm"),
        ({"structures": {"ventricle": 1.0}}, "structures names ventricle"),
        ({"structures": {"ventricles": [1.0, 7.0]}}, "ventricles is 7.0"),
        ({"structures": {"ventricles": [2.0, 1.0]}}, "neither a number nor a range"),
        ({"shape": {"thicknes": 2.5}}, "shape names thicknes"),
        ({"shape": [1]}, "'knob: number'"),
        ({"procedural_shape": {"kind": "template"}}, "shape names kind"),
        ({"position": {"voxel": 1}}, "position sets voxel, which nothing reads"),
        ({"position": {"orientation": "XYZ"}}, "one letter"),
        ({"position": {"rotation_degrees": "much"}}, "rotation_degrees is 'much'; a finite number"),
        ({"appearance": {}}, "signal is None"),
        ({"appearance": {"signal": {"white": 1.0}}}, "signal names"),
        ({"appearance": {"signal": SIGNAL, "noize": 1.0}}, "appearance names noize"),
        ({"appearance": {"signal": SIGNAL, "noise": "loud"}}, "'loud' is neither"),
        ({"appearance": {"signal": SIGNAL, "noise": float("nan")}}, "neither a number"),
        ({"appearance": {"signal": SIGNAL, "noise": [-1.0, 1.0]}}, "not possible"),
        ({"appearance": {"signal": SIGNAL, "bias_mm": [0, 60]}}, "not possible"),
    ],
)
def test_every_knob_is_checked(unchecked, entries, words):
    refuses(words, recipe, **entries)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("name: [", "cannot be read as plain YAML"),
        ("- 1\n- 2\n", "holds .*; names and values are needed"),
        ("", "holds None; names and values are needed"),
        ("name: x\n", "lacks seed"),
        (yaml.safe_dump(LEAST | {"colour": "red"}), "sets colour, which nothing reads"),
    ],
)
def test_broken_files_are_refused(tmp_path, text, words):
    (tmp_path / "a.yaml").write_text(text)
    refuses(words, read_recipe, tmp_path / "a.yaml")


def test_a_missing_file_is_refused(tmp_path):
    refuses("does not exist", read_recipe, tmp_path / "no.yaml")


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
    refuses(words, People.read, entries, "people")


def test_a_recipe_without_people_is_drawn_as_before():
    recipe = read_recipe("oasis_like")
    shape, anatomy, position = _drawn(recipe, plan(recipe)[0])
    assert (shape.mirrored, anatomy.leaf_mm, anatomy.blemishes, position.orientation) == (None, None, None, "RAS")
    varied = read_recipe("people_like")
    assert People.read(varied.people) == People(recess=(0.1, 0.9))
    assert all(_drawn(varied, person)[1].leaf_mm for person in plan(varied)[:5])
