"""The sweep of chapter 1: its committed results belong to its configuration, and its parts compute what they say."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

FOLDER = Path(__file__).resolve().parents[2] / "experiments" / "circle_to_polygon"


def test_runs_are_repeatable_and_paired(part, config):
    toy = part("run")
    small = config | {"n_steps": 15, "n_directions": 10}
    run = {"n_points": 40, "sampling": "random", "polygon": "letter_e", "reduction": "sum", "learning_rate": 0.5}
    sliced = run | {"loss": "sliced", "redraw": True}
    first = toy.run_once(sliced, 3, small)
    assert first == toy.run_once(sliced, 3, small)
    assert first != toy.run_once(sliced, 4, small)
    assert first["w2"] < toy.run_once(sliced, 3, small | {"n_steps": 1})["w2"]


def test_sum_is_n_times_the_mean(part, config):
    toy = part("run")
    run = {"n_points": 30, "sampling": "even", "polygon": "acute_star", "loss": "chamfer"}
    small = config | {"n_steps": 5}
    summed = toy.run_once(run | {"reduction": "sum", "learning_rate": 0.01}, 0, small)
    mean = toy.run_once(run | {"reduction": "mean", "learning_rate": 0.3}, 0, small)
    assert summed["w2"] == pytest.approx(mean["w2"], rel=1e-9)


def test_each_regulariser_moves_the_points(part, config):
    toy = part("run")
    small = config | {"n_steps": 5}
    run = {"n_points": 30, "sampling": "even", "polygon": "acute_star", "loss": "chamfer", "reduction": "mean"}
    run["learning_rate"] = 1.0
    plain = toy.run_once(run, 0, small)["w2"]
    for name in config["regularisers"]["weights"]:
        held = toy.run_once(run | {"regulariser": name, "weight": 0.1}, 0, small)["w2"]
        assert abs(held - plain) > 1e-6


def test_summary_of_known_numbers(part):
    summary = part("run")
    run = {"part": "summary", "polygon": "p", "sampling": "even", "reduction": "mean"}
    rows = []
    for loss, values in (("chamfer", (3.0, 5.0)), ("sliced", (1.0, 2.0))):
        setting = run | {"loss": loss} | ({"redraw": True} if loss == "sliced" else {})
        rows += [{"run": setting, "values": dict.fromkeys(summary.MEASURED, value)} for value in values]
    results = json.loads(json.dumps(summary.summarise(rows)))
    assert [row["w2_mean"] for row in results["summary"]] == [4, 1.5]
    (difference,) = results["differences"]
    half = stats.t.ppf(0.975, 1) * np.std([2, 3], ddof=1) / np.sqrt(2)
    assert (difference["w2_mean"], difference["w2_low"]) == (2.5, pytest.approx(2.5 - half, rel=1e-5))
