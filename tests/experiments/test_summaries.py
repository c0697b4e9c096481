"""What is committed of each experiment follows from the repetitions that are committed beside it."""

import itertools
import json
from pathlib import Path

import numpy as np
import pytest

from meshot.provenance import read_results, rounded

EXPERIMENTS = Path(__file__).resolve().parents[2] / "experiments"


def committed(name: str) -> dict:
    return read_results(EXPERIMENTS / name / "results.json")


def numbers(value, path=()):
    """Every leaf by where it stands."""
    if isinstance(value, dict | list):
        items = value.items() if isinstance(value, dict) else enumerate(value)
        return {key: x for name, item in items for key, x in numbers(item, (*path, str(name))).items()}
    return {path: value}


def require_equal(again, kept, rel: float = 1e-5, abs: float = 0.0):
    """Equal in six digits (of which the last may turn over), unless something else is said."""
    found, wanted = numbers(json.loads(json.dumps(again))), numbers(kept)
    assert found.keys() == wanted.keys()
    for key, value in wanted.items():
        assert found[key] == (pytest.approx(value, rel=rel, abs=abs) if isinstance(value, float) else value), key


def has(*names):
    """Rows of whatever it is, by what tells them apart."""
    return lambda rows: {tuple(row[name] for name in names) for row in rows}


FIT = ("target", "start", "seed", "loss", "encoding", "supports", "learning_rate")
#: By experiment, what the configuration asks for, and what of it is in the results, or named as missing.
PLANS = {
    "deforming": (
        lambda run, config: has(*FIT)(run.planned_fits(config)),
        lambda results: has(*FIT)(results["fits"] + results["missing"]),
    ),
    "fixed_supports": (
        lambda run, config: has("variant", "n_supports")(run.planned_fits(config)),
        lambda results: has("variant", "n_supports")(results["fits"]),
    ),
    "directions": (
        lambda run, config: has("d", "pair", "p", "method")(row for row in run.tasks(config) if "method" in row),
        lambda results: has("d", "pair", "p", "method")(results["savings"]),
    ),
    "beyond_random": (
        lambda run, config: set(itertools.product(config["pairs"], config["dimensions"], run.METHODS)),
        lambda results: has("pair", "d", "method")(results["methods"]),
    ),
    "study": (
        lambda run, config: {(f"sub-{label}", group) for (group, _), label in run.labels_of(config).items()},
        lambda results: has("participant_id", "group")(results["people"]),
    ),
}


@pytest.mark.parametrize("name", PLANS)
def test_what_was_planned_is_there(part_of, name):
    planned, found = PLANS[name]
    record = committed(name)
    assert planned(part_of(name, "run"), record["config"]) == found(record["results"])


def test_the_ranking_of_directions(part_of):
    record = committed("directions")
    again = part_of("directions", "run").ranking(record["results"]["errors"], record["config"]["n_directions"])
    assert again == record["results"]["ranking"]


def test_circle_to_polygon(part_of):
    summary, results = part_of("circle_to_polygon", "run"), committed("circle_to_polygon")["results"]
    main = [row for row in results["summary"] if row["reduction"] == "mean"]
    for kept in results["differences"]:
        same = [r for r in main if (r["polygon"], r["sampling"]) == (kept["polygon"], kept["sampling"])]
        (trapped,) = (r for r in same if r["loss"] == "chamfer")
        (rival,) = (r for r in same if r["loss"] == "sliced" and r["redraw"] == kept["redraw"])
        require_equal(summary._difference(trapped, rival), kept)


def test_blur(part_of):
    run, results = part_of("blur", "run"), committed("blur")["results"]
    sliced, *others = results["fits"]
    assert sliced["loss"] == "sliced"
    for row, kept in zip(others, results["differences"], strict=True):
        # Seeds are committed in six digits: a difference of two is off by 5e-6 of both.
        largest = max(max(np.abs(arm[f"{name}_seeds"])) for arm in (row, sliced) for name in run.MEASURED)
        require_equal(run._difference(row, sliced), kept, abs=1e-5 * largest)


def test_weights_and_areas(part_of):
    summary, results = part_of("weights_and_areas", "run"), committed("weights_and_areas")["results"]
    for kept in results["differences"]:
        wanted = ((False, kept["rate_full"]), (True, kept["rate_stopped"]))
        arms = [
            next(r for r in results["descents"] if (r["target"], r["encoding"], r["detach_weights"], r["learning_rate"])
                 == (kept["target"], kept["encoding"], *keys))
            for keys in wanted
        ]  # fmt: skip
        require_equal(summary._difference(*arms), kept)


def test_self_intersection(part_of):
    results = committed("self_intersection")["results"]
    differences = part_of("self_intersection", "run").differences(results["fits"])
    require_equal(rounded(differences), results["differences"])


def test_fixed_supports(part_of):
    results = committed("fixed_supports")["results"]
    require_equal(part_of("fixed_supports", "run").differences(results["fits"]), results["differences"])


def test_deforming(part_of):
    summary, results = part_of("deforming", "summary"), committed("deforming")["results"]
    require_equal(summary.summarise(results["fits"]), results["summary"])
    require_equal(summary.differences(results["fits"]), results["differences"])


@pytest.mark.parametrize(("metric", "setting"), [("exact_w2", {}), ("sinkhorn", {"blur": 0.05, "debias": True})])
def test_floors(part_of, metric, setting):
    run, record = part_of("floors", "run"), committed("floors")

    def values_of(name, setting):
        (row,) = (r for r in record["results"]["floors"] if (r["metric"], r["surface"]) == (name, "white left")
                  and r["setting"] == setting)  # fmt: skip
        return row, {group["m"]: group["values"] for group in row["measured"]}

    kept, groups = values_of(metric, setting)
    _, of_exact = values_of("exact_w2", {})
    surface = ("white", "left")
    exact = {(surface, m, seed): value for m, values in of_exact.items() for seed, value in enumerate(values)}
    again = run.floor_row(metric, surface, tuple(setting.items()), groups, exact, record["config"])
    # Values are committed in six digits; a line through a few sizes carries that error on to the paper's number of
    # points, which lies less than ten times as far from their middle as they do.
    require_equal(again, kept, rel=1e-4)
