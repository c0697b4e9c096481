"""The experiments of chapter 7: committed results belong to their configuration, and a slice of each is made again."""

from pathlib import Path

import pytest

from meshot.provenance import read_results

EXPERIMENTS = Path(__file__).resolve().parents[2] / "experiments"
pytestmark = pytest.mark.usefixtures("one_thread")


def committed(experiment: str) -> tuple[dict, dict]:
    record = read_results(EXPERIMENTS / experiment / "results.json")
    assert "1 threads" in record["machine"]
    return record["results"], record["config"]


def test_exact_values_are_made_again(part_of):
    results, config = committed("exact_value")
    accuracy = part_of("exact_value", "run")
    rows = accuracy._closed_forms(config["accuracy"], 2)
    named = {(row["case"], row["p"]): row for row in results["accuracy"]["values"]}
    for row in rows:
        assert row["exact"] == named[row["case"], 2]["exact"]
        assert row["error"] < 1e-13
    spheres = accuracy._spheres({"sphere_subdivisions": [1, 2]})
    for row, stored in zip(spheres, results["accuracy"]["spheres"]):
        assert row["relative_error"] == pytest.approx(stored["relative_error"], rel=1e-9)


def test_sampled_errors_are_made_again(part_of):
    results, config = committed("exact_value")
    sampling = part_of("exact_value", "run")
    pair = sampling.pairs(config)["spheres of 40 and 38"]
    stored = next(row for row in results["sampling"] if row["pair"] == "spheres of 40 and 38")
    directions = sampling.quasi_directions(config["n_directions"], 3)
    exact = float(sampling.sliced_wasserstein(*map(sampling.surface, pair), directions))
    assert exact == pytest.approx(stored["exact"], rel=1e-10)
    again = sampling._sampled(pair, 1000, exact, directions, config)
    assert again["rms_error"] == pytest.approx(stored["sampled"][0]["rms_error"], rel=1e-8)


def test_a_descent_starts_where_it_did_and_falls(part_of):
    results, config = committed("exact_value")
    fitting = part_of("exact_value", "run")
    short = config | {"descent": config["descent"] | {"n_steps": 3}}
    run = fitting.descend_once("continuous", 0, results["descent"][0]["rate"], short)
    stored = results["descent"][0]
    assert run["start"]["sliced_distance"] == pytest.approx(stored["start"]["sliced_distance"], rel=1e-9)
    assert stored["end"]["sliced_distance"] < run["end"]["sliced_distance"] < run["start"]["sliced_distance"]


def test_shares_of_the_normals_are_made_again(part_of):
    results, config = committed("normal_scale")
    shares = part_of("normal_scale", "run")
    stored = next(row for row in results["pairs"] if row["pair"] == "folds, deep and shallow")
    pair = shares.pairs(config)["folds, deep and shallow"]
    assert shares.scales_of(config, pair[0]) == [row["scale"] for row in stored["rows"]]
    entry = next(row for row in stored["rows"] if row["scale"] == 10)
    again = shares.measure_scale(*pair, 10.0, config)
    for key in ("value", "share", "gradient_share", "wrong_neighbours"):
        assert again[key] == pytest.approx(entry[key], rel=1e-6, abs=1e-9)


def test_where_the_normals_make_half(part_of):
    shares = part_of("normal_scale", "run")
    rows = [{"scale": s, "share": g} for s, g in ((1.0, 0.0), (10.0, 0.25), (100.0, 0.75))]
    assert shares.crossing_scale(rows) == pytest.approx(10**1.5)
    assert shares.crossing_scale(rows[:2]) is None


def test_slopes_are_made_again(part_of):
    results, config = committed("sample_gradient")
    bias = part_of("sample_gradient", "run")
    few = config | {"losses": config["losses"] | {"n_draws": 60, "sizes": [100]}}
    for row in bias.losses(few):
        stored = next(r for r in results["losses"] if (r["case"], r["n_points"]) == (row["case"], 100))
        assert row["exact"] == pytest.approx(stored["exact"], rel=1e-9)
        assert row["by_differences"] == pytest.approx(row["exact"], rel=1e-6)
        for kind in ("fixed_draws", "carried"):
            assert (
                row[kind]["low"] - row[kind]["sd"] / 7 < stored[kind]["mean"] < row[kind]["high"] + row[kind]["sd"] / 7
            )


def test_a_polygon_descends_as_it_did(part_of):
    results, config = committed("sample_gradient")
    fitting = part_of("sample_gradient", "run")
    run = fitting.descend_once(6, "continuous", 0, config["descent"])
    stored = next(row for row in results["descent"] if (row["n_corners"], row["kind"]) == (6, "continuous"))
    assert run["sliced_distance"] == pytest.approx(stored["sliced_distance"], rel=1e-3)
