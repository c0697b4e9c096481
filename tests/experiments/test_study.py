"""The study of chapter 25: its labels hide the groups, which differ in atrophy alone."""

from pathlib import Path

FOLDER = Path(__file__).resolve().parents[2] / "experiments" / "study"


def test_every_person_has_a_label_that_does_not_tell_the_group(part, config):
    labels = part("run").labels_of(config)
    n_people = config["people"]
    assert sorted(labels.values()) == [f"{i + 1:02d}" for i in range(2 * n_people)]
    first_half = {group for (group, _), label in labels.items() if int(label) <= n_people}
    assert first_half == set(config["groups"])


def test_the_recipes_of_the_groups_differ_in_atrophy_only(part, config):
    run = part("run")
    first, second = (run.recipe_of(config, group) for group in config["groups"])
    assert first.position == second.position
    assert first.appearance == second.appearance
    assert {name for name in first.shape if first.shape[name] != second.shape[name]} == {"atrophy"}
    assert run.recipe_of(config, "patient", atrophy=0.0).shape == first.shape
