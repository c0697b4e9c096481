"""The study of chapter 25: its labels hide the groups, its rows are whole, and its truth has the atrophy."""

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


def test_the_committed_rows_are_those_of_the_configuration(record, part):
    config = record["config"]
    people, visits = record["results"]["people"], record["results"]["visits"]
    labels = part("run").labels_of(config)
    assert {person["participant_id"]: person["group"] for person in people} == {
        f"sub-{label}": group for (group, _), label in labels.items()
    }
    expected = [(p["participant_id"], f"ses-{k + 1:02d}") for p in people for k in range(config["visits"])]
    assert sorted((row["participant_id"], row["session_id"]) for row in visits) == expected
    assert {(row["status"], row["left_white_euler"], row["right_white_euler"]) for row in visits} == {("done", 2, 2)}


def test_atrophy_makes_the_same_person_smaller(record):
    """Of those whose random deformation is the same without atrophy: chapter 25 leaves the others out."""
    compared = 0
    for person in record["results"]["people"]:
        if person["group"] != "patient":
            assert not any("before" in name for name in person)
        elif person["strength_before"] == person["strength"]:
            compared += 1
            ratios = [person[f"{side}_volume_mm3"] / person[f"{side}_before_volume_mm3"] for side in ("left", "right")]
            assert all(0.85 < ratio < 0.98 for ratio in ratios)
    assert compared >= 3
