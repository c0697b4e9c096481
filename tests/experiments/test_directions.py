"""The comparison of constructions: a slice rebuilds its committed results, which lead to the defaults."""

from pathlib import Path

import numpy as np
import pytest

from meshot.loss.directions import DEFAULTS

FOLDER = Path(__file__).resolve().parents[2] / "experiments" / "directions"


@pytest.mark.parametrize(
    ("d", "pair", "p", "method"),
    [(3, "translation", 1, "spiral"), (6, "translation", 2, "sobol"), (2, "translation", 1, "orthogonal")],
)
def test_a_slice_of_it_again(part, config, record, d, pair, p, method):
    slices, problem = part("run"), {"d": d, "pair": pair, "p": p}
    small = config | {"n_directions": [10, 100]}
    if method in slices.NESTED:
        small["n_directions"] = config["n_directions"]
    mean, _ = slices.mean_over_all(problem, config)
    rmse = np.sqrt(np.square(slices.relative_errors(problem, method, mean, small)).mean(axis=0))
    for count, value in zip(small["n_directions"], rmse, strict=True):
        (row,) = [
            r for r in record["results"]["errors"] if (problem | {"method": method, "L": count}).items() <= r.items()
        ]
        assert value == pytest.approx(row["rmse"], rel=1e-3)


def test_costs_of_each_pair_are_positive_and_its_means_repeat(part, config, record):
    slices = part("run")
    sets = [setting | {"n_directions": 3000} for setting in config["reference"]["sets"]]
    few = config | {"reference": {"n_turns": 2, "sets": sets}}
    for d in (2, 6):
        for pair in ("ellipsoid", "folded"):
            problem = {"d": d, "pair": pair, "p": 2}
            (row,) = [r for r in record["results"]["means"] if problem.items() <= r.items()]
            assert slices.mean_over_all(problem, few)[0] == pytest.approx(row["mean"], rel=0.02)


def test_defaults_are_the_best_by_formula(record):
    for d in (2, 3, 6):
        rows = [r for r in record["results"]["ranking"] if r["d"] == d]
        formulas = [r for r in rows if r["method"] not in ("random", "orthogonal", "repelling")]
        for count in (100, 1000):
            assert min(formulas, key=lambda r: r[f"ratio_{count}"])["method"] == DEFAULTS.get(d, "sobol")


def test_summary_of_known_numbers(part):
    summary = part("run")
    key, generator = {"d": 3, "pair": "folded", "p": 2}, np.random.default_rng(0)
    noise = generator.choice([-1.0, 1.0], size=(50, 2))
    found = [
        key | {"method": "random", "errors": noise * [0.1, 0.05]},
        key | {"method": "x", "errors": noise * [0.05, 0.005]},
    ]
    results = summary.summarise(found, {"n_directions": [100, 400], "n_resamples": 100})
    assert [row["rmse"] for row in results["errors"]] == [0.1, 0.05, 0.05, 0.005]
    random, other = results["savings"]
    assert random["slope"] == pytest.approx(-0.5, abs=1e-3)
    assert other["factor"] == pytest.approx(2, abs=1e-3)
    assert results["ranking"][0] == {"d": 3, "method": "x", "ratio_100": 0.5, "ratio_400": 0.1, "worst_100": 0.5}
