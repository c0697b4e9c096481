"""Slices that depend on the measures, after equal time: every loss descends, and the choice is made on other seeds."""

from pathlib import Path

import pytest

from meshot.settings import read_yaml

FOLDER = Path(__file__).resolve().parents[2] / "experiments" / "slices"


@pytest.fixture
def toy(part_of):
    return part_of("slices", "run")


@pytest.fixture
def settings():
    return read_yaml(FOLDER / "config.yaml") | {"n_points": 30, "seconds": 0.05}


def test_every_loss_brings_the_points_nearer(toy, settings):
    for name, numbers in settings["losses"].items():
        found = toy.descent(name, numbers[-1], 0.3, 0, settings)
        assert found["n_steps"] >= 1, name
        if found["n_steps"] > 20:  # a busy machine may do a few steps only
            assert found["w2"] < found["start"], name


def test_settings_are_chosen_on_some_seeds_and_judged_on_others(toy, settings):
    settings = settings | {"losses": {"sliced, random": [5, 30], "energy-based": [10]}, "learning_rates": [1.0]}
    ends = {("sliced, random", 5): (1.0, 0.1), ("sliced, random", 30): (0.5, 0.2), ("energy-based", 10): (0.7, 0.3)}
    rows = []
    for task in toy.tasks(settings):
        name, n, _, seed = task
        w2 = ends[name, n][0] if seed in settings["choice"] else ends[name, n][1] + 0.01 * (seed % 2)
        rows.append({"task": task, "found": {"w2": w2, "n_steps": 10, "start": 2.0}})
    sliced, energy = toy.results(rows, settings)["chosen"]
    assert sliced["n_lines"] == 30  # the other one is better on the seeds that judge
    assert sliced["w2"] == pytest.approx(0.204)
    assert energy["difference"] == pytest.approx(0.1)
    assert energy["half_width"] == pytest.approx(0, abs=1e-12)
    assert sliced["w2_error"] == pytest.approx(0.01 * 0.3**0.5 / 5**0.5, rel=1e-3)
