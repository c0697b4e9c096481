"""Measure the error of the theorem: slopes in numbers of points and directions and in the dimension, and its bounds."""

import functools
import sys
from pathlib import Path

import numpy as np
import torch
from directions import direction_errors, direction_runs, direction_summary
from pairs import Pair, frames, make_pair, sampled_costs
from sizes import distance_errors, distance_runs, distance_summary, size_errors, size_runs, size_summary

from meshot import DiscreteMeasure, slice_costs
from meshot.loss import projected_law
from meshot.types import Array, Float
from meshot_book.statistics import short

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment


def bound_runs(config: dict) -> list[dict]:
    """All combinations of pair and number of points."""
    settings = config["bounds"]
    return [{"part": "bounds", "d": d, "n_points": m} for d in settings["dimensions"] for m in settings["points"]]


def bound_values(run: dict, config: dict) -> dict:
    """Measured errors, one-sided distances (mean and maximum over directions), and all bounds."""
    settings, exponents, m = config["bounds"], config["exponents"], run["n_points"]
    pair = make_pair("generic", run["d"])
    directions = frames(settings["n_directions"], run["d"], config["seed"])
    truth = np.array([pair.true_costs(directions, p) for p in exponents])
    means, slices, sides, largest = [], [], [], []
    for repetition in range(settings["n_repetitions"]):
        generator = np.random.default_rng([config["seed"], 8, m, repetition])
        points, others = pair.draw_source(m, generator), pair.draw_target(m, generator)
        gaps = sampled_costs(points, others, directions.numpy(), exponents) - truth
        means.append(np.abs(gaps.mean(axis=1)))
        slices.append(np.abs(gaps).mean(axis=1))
        both = [
            slice_costs(DiscreteMeasure(torch.from_numpy(cloud)), measure, directions, 1).numpy()
            for cloud, measure in ((points, pair.source), (others, pair.target))
        ]
        sides.append(sum(costs.mean() for costs in both))
        largest.append(sum(costs.max() for costs in both))
    measured = {"error": np.mean(means, axis=0), "slice_error": np.mean(slices, axis=0)}
    return (
        {key: value.tolist() for key, value in measured.items()}
        | {"one_sided": float(np.mean(sides)), "one_sided_max": float(np.mean(largest))}
        | all_bounds(
            pair, m, run["d"], exponents, projected_spreads("generic", run["d"], len(directions), config["seed"])
        )
    )


def all_bounds(pair: Pair, n_points: int, d: int, exponents: list, projected: tuple[Array, Array]) -> dict:
    """The bound of the paper's proof with a textbook constant, and bounds without a supremum."""
    sizes = diameter(pair.source.vertices.numpy()), diameter(pair.target.vertices.numpy())
    joint = diameter(np.concatenate([pair.source.vertices.numpy(), pair.target.vertices.numpy()]))
    # Devroye and Lugosi, 2001, Theorem 3.1; half-spaces of R^d pick at most (m + 1)^(d + 1) subsets of m points.
    supremum = 2 * np.sqrt((np.log(2) + (d + 1) * np.log(n_points + 1)) / n_points)
    spreads, extents = projected
    steepness = [p * joint ** (p - 1) for p in exponents]
    return {
        "diameters": [*sizes, joint],
        "paper": [steep * sum(sizes) * supremum for steep in steepness],
        "sharper": [steep * sum(sizes) / (2 * np.sqrt(n_points)) for steep in steepness],
        "projected": [float(np.mean(p * extents ** (p - 1) * spreads) / np.sqrt(n_points)) for p in exponents],
        "one_sided_paper": sum(sizes) * supremum,
        "one_sided_sharper": sum(sizes) / (2 * np.sqrt(n_points)),
        "one_sided_projected": float(spreads.mean() / np.sqrt(n_points)),
    }


def diameter(points: Float[Array, "n d"]) -> float:
    """The largest distance between two of the points."""
    squares = (points * points).sum(axis=1)
    largest = 0.0
    for start in range(0, len(points), 500):
        block = points[start : start + 500]
        gaps = (block * block).sum(axis=1)[:, None] + squares - 2 * block @ points.T
        largest = max(largest, float(gaps.max()))
    return float(np.sqrt(largest))


@functools.cache
def projected_spreads(name: str, d: int, n_directions: int, seed: int, n_places: int = 2000) -> tuple[Array, Array]:
    """∫√(F(1 − F)) + ∫√(G(1 − G)) of a pair for every direction, and the joint extent of its two projections."""
    pair, spreads, extents = make_pair(name, d), [], []
    for direction in frames(n_directions, d, seed):
        ends, spread = [], 0.0
        for measure in (pair.source, pair.target):
            projected = measure.vertices.numpy() @ direction.numpy()
            ends += [projected.min(), projected.max()]
            places = np.linspace(projected.min(), projected.max(), n_places)
            share = projected_law(measure, direction).distribution(places)
            spread += np.trapezoid(np.sqrt(share * (1 - share)), places)
        spreads.append(spread)
        extents.append(max(ends) - min(ends))
    return np.array(spreads), np.array(extents)


def bound_summary(rows: list[dict], config: dict) -> dict:
    """One row per pair, exponent and number of points."""
    found = []
    for row in rows:
        for index, p in enumerate(config["exponents"]):
            told = {key: row["run"][key] for key in ("d", "n_points")} | {"p": p}
            for key, value in row["values"].items():
                if key == "diameters":
                    told |= {key: [short(size) for size in value]}
                else:
                    told[key] = short(value[index] if isinstance(value, list) else value)
            found.append(told)
    return {"bounds": found}


#: For each part: its runs, the function of a run, and the summary of the rows.
PARTS = {
    "distance": (distance_runs, distance_errors, distance_summary),
    "bounds": (bound_runs, bound_values, bound_summary),
    "sizes": (size_runs, size_errors, size_summary),
    "directions": (direction_runs, direction_errors, direction_summary),
}


def tasks(config: dict) -> list[dict]:
    """The runs of all parts."""
    return [run for runs_of, _, _ in PARTS.values() for run in runs_of(config)]


def work(run: dict, config: dict) -> object:
    """One run."""
    return PARTS[run["part"]][1](run, config)


def results(rows: list[dict], config: dict) -> dict:
    """The summaries of all parts."""
    found, runs = {}, [{"run": row["task"], "values": row["found"]} for row in rows]
    for part, (_, _, summary) in PARTS.items():
        found |= summary([row for row in runs if row["run"]["part"] == part], config)
    return found


if __name__ == "__main__":
    experiment.run(__file__, tasks, work, results, "synthetic surfaces and contours, with features")
