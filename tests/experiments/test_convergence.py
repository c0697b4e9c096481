"""The experiment on the theorem: its truths against closed forms, and committed numbers rebuilt from their seeds."""

from pathlib import Path

import numpy as np
import pytest
import torch
from scipy import integrate

from meshot import DiscreteMeasure, random_directions, slice_costs
from refusals import refuses

FOLDER = Path(__file__).resolve().parents[2] / "experiments" / "convergence"
pytestmark = pytest.mark.usefixtures("one_thread")


@pytest.mark.parametrize("p", [1, 2, 3])
@pytest.mark.parametrize(("shift", "excess"), [(0.0, 2.0), (1.5, 2.0), (5.0, 2.0), (-5.0, -2.0)])
def test_costs_of_intervals_by_quadrature(part, shift, excess, p):
    def gap(u):
        return abs(shift + excess * u) ** p

    points = [-shift / excess] if abs(shift) < abs(excess) else None
    truth = integrate.quad(gap, -1, 1, points=points)[0] / 2
    assert float(part("pairs").interval_costs(np.array(shift), excess, p)) == pytest.approx(truth, rel=1e-9)


@pytest.mark.parametrize(("d", "n"), [(2, 12), (3, 12), (6, 12), (12, 12), (24, 24)])
def test_directions_are_whole_frames(part, d, n):
    lines = part("pairs").frames(n, d, 0)
    torch.testing.assert_close(lines.T @ lines, torch.eye(d, dtype=torch.float64) * n / d)


def test_sorted_costs_are_those_of_the_loss(part):
    generator = np.random.default_rng(0)
    x, y = generator.normal(size=(2, 50, 3))
    lines = random_directions(7, 3, 1)
    found = part("pairs").sampled_costs(x, y, lines.numpy(), [1, 2, 3])
    for row, p in zip(found, (1, 2, 3)):
        truth = slice_costs(*(DiscreteMeasure(torch.from_numpy(z)) for z in (x, y)), lines, p)
        assert row == pytest.approx(truth.numpy(), rel=1e-9)


@pytest.mark.parametrize("name", ["generic", "equal"])
@pytest.mark.parametrize("d", [3, 6, 12, 24])
def test_draws_are_of_the_measures_they_stand_for(part, name, d):
    pair = part("pairs").make_pair(name, d)
    points = pair.draw_source(4000, np.random.default_rng(0))
    vertices, cells = pair.source.vertices.numpy(), pair.source.cells.numpy()
    means = vertices[cells].mean(axis=1)
    error = points.mean(axis=0) - pair.source.weights.numpy() @ means
    assert points.shape == (4000, d)
    assert np.abs(error).max() < 4.5 * points.std(axis=0).max() / np.sqrt(4000)


@pytest.mark.parametrize(("d", "p", "mean"), [(3, 2, 48.0), (6, 2, 24.0), (3, 1, 6.0), (3, 4, 12**4 / 5)])
def test_moments_of_a_translation(part, d, p, mean):
    assert part("directions").translation_mean(d, p) == pytest.approx(mean, rel=1e-9)


def test_two_dimensional_and_unknown_pairs(part):
    pairs = part("pairs")
    assert pairs.make_pair("contours", 2).draw_source(5, np.random.default_rng(0)).shape == (5, 2)
    refuses("'triangle'", pairs.make_pair, "triangle", 3)
    refuses("d is 4", pairs.make_pair, "generic", 4)


@pytest.mark.parametrize("name", ["generic", "equal, features", "concentric", "plane"])
def test_committed_errors_are_rebuilt(part, config, results, name):
    sizes = part("sizes")
    (run,) = [r for r in sizes.size_runs(config) if r["name"] == name and r["n_points"] == 100]
    values = sizes.size_errors(run, config)
    for p, errors in zip(config["exponents"], values["errors"]):
        (row,) = [r for r in results["sizes"] if (r["pair"], r["p"]) == (name, p)]
        assert np.abs(errors).mean() == pytest.approx(row["error"][0], rel=1e-5)
        assert row["n_repetitions"][0] == len(errors) == 200


def test_committed_distances_and_bounds_are_rebuilt(part, config, results):
    distance, bounds = part("sizes"), part("run")
    runs = [run for run in distance.distance_runs(config) if run["n_points"] == 100]
    rows = [{"run": run, "values": distance.distance_errors(run, config)} for run in runs]
    small = config | {"distance": config["distance"] | {"points": [100]}}
    again = distance.distance_summary(rows, small)["distance"]
    for row, kept in zip(again, (r for r in results["distance"] if r["n_points"] == 100), strict=True):
        for name in ("error", "ratio", "ratio_low", "ratio_high"):
            assert row[name] == pytest.approx(kept[name], rel=1e-5)
    values = bounds.bound_values({"d": 3, "n_points": 100}, config)
    (row,) = [r for r in results["bounds"] if (r["d"], r["n_points"], r["p"]) == (3, 100, 2)]
    assert [values["sharper"][1], values["slice_error"][1]] == pytest.approx(
        [row["sharper"], row["slice_error"]], rel=1e-5
    )


def test_a_diameter_is_the_largest_distance(part):
    points = np.random.default_rng(2).normal(size=(700, 4))
    truth = np.linalg.norm(points[:, None] - points[None], axis=2).max()
    assert part("run").diameter(points) == pytest.approx(truth, rel=1e-9)


def test_a_small_slice_of_the_directions(part, config):
    directions = part("directions")
    small = config | {"directions": config["directions"] | {"counts": [1, 10, 100], "n_quadrature": 3000}}
    runs = [run | ({"n_pool": 20_000} if "n_pool" in run else {}) for run in directions.direction_runs(config)]
    for run in (runs[0], runs[4]):
        rows = [{"run": run, "values": directions.direction_errors(run, small)}]
        for row in directions.direction_summary(rows, small)["directions"]:
            assert row["slope"] == pytest.approx(-0.5, abs=0.02)
            assert row["constant"] == pytest.approx([1.0] * 3, abs=0.08)
