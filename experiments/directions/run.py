"""Measure which construction of directions has the smallest error, in two, three and six dimensions."""

import functools
import math
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch

from meshot import (
    DiscreteMeasure,
    orthogonal_directions,
    quasi_directions,
    random_directions,
    slice_costs,
    surface,
    varifold,
)
from meshot.loss import CONSTRUCTIONS
from meshot.measure import SurfaceMeasure
from meshot.mesh import Contour, circle, ellipsoid, folded_sphere, icosphere, letter_e, star
from meshot.statistics import percentile_interval

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment

Measure = SurfaceMeasure | DiscreteMeasure
Cost = Callable[[torch.Tensor], np.ndarray]


def slice_cost(problem: dict, config: dict) -> Cost:
    """The function from directions to W_p^p along each of them."""
    p = problem["p"]
    if problem["pair"] == "translation":
        return lambda directions: np.abs(directions[:, 0].numpy()) ** p
    source, target = _pair(problem["d"], problem["pair"], config)
    return lambda directions: slice_costs(source, target, directions, p).numpy()


def _pair(d: int, name: str, config: dict) -> tuple[Measure, Measure]:
    if d == 2:
        round_one = circle(n_corners=90)
        long = Contour(round_one.vertices * torch.tensor(config["radii"][:2]), round_one.edges)
        return {
            "ellipsoid": (surface(long), surface(round_one)),
            "folded": (surface(star(5, 1.5, 0.35)), surface(letter_e())),
        }[name]
    level = config["subdivisions"]
    other = {
        "ellipsoid": lambda: ellipsoid(level, tuple(config["radii"])),
        "folded": lambda: folded_sphere(level, 1.0, 0.2),
    }
    encode = surface if d == 3 else lambda mesh: varifold(mesh, normal_scale=config["normal_scale"])
    return encode(other[name]()), encode(icosphere(level))


def mean_over_all(problem: dict, config: dict) -> tuple[float, float]:
    """The mean over all directions and its standard error, which is zero if there is a closed form, E|θ₁|^p."""
    d, p = problem["d"], problem["p"]
    if problem["pair"] == "translation":
        moment = math.gamma(d / 2) * math.gamma((p + 1) / 2) / (math.gamma((d + p) / 2) * math.sqrt(math.pi))
        return moment, 0.0
    cost = slice_cost(problem, config)
    (setting,) = [entry for entry in config["reference"]["sets"] if entry["d"] == d]
    n_turns = config["reference"]["n_turns"]
    means = [
        cost(quasi_directions(setting["n_directions"], d, 10_000 + turn, method=setting["method"])).mean()
        for turn in range(n_turns)
    ]
    return float(np.mean(means)), float(np.std(means, ddof=1) / math.sqrt(n_turns))


def methods(d: int) -> dict[str, Callable[[int, int], torch.Tensor]]:
    """The constructions by name, each as a function from (number, seed) to directions."""
    found = {"random": lambda n, seed: random_directions(n, d, seed)}
    found["orthogonal"] = lambda n, seed: orthogonal_directions(n, d, seed)
    for name, (_, only) in CONSTRUCTIONS.items():
        if only in (None, d):
            found[name] = functools.partial(_quasi, d, name)
    return found


def _quasi(d: int, name: str, n: int, seed: int) -> torch.Tensor:
    return quasi_directions(n, d, seed, method=name)


#: Constructions in which the first L rows of a long set are the set of L rows, so that one set serves every L.
NESTED = ("random", "orthogonal", "lattice", "sobol", "sobol frames")


def relative_errors(problem: dict, method: str, mean: float, config: dict) -> np.ndarray:
    """estimate / mean − 1, with shape (repetitions, numbers of directions)."""
    cost, make, counts = slice_cost(problem, config), methods(problem["d"])[method], config["n_directions"]
    errors = np.empty((config["n_repetitions"], len(counts)))
    for seed in range(config["n_repetitions"]):
        if method in NESTED:
            costs = cost(make(max(counts), seed))
            estimates = [costs[:n].mean() for n in counts]
        else:
            estimates = [cost(make(n, seed)).mean() for n in counts]
        errors[seed] = np.array(estimates) / mean - 1
    return errors


RANKED_AT = 100


def summarise(found: list[dict], config: dict) -> dict:
    """The summary of ``found``: one row per problem and method with its relative errors (repetitions × counts)."""
    counts = config["n_directions"]
    rows, savings = [], []
    for entry in found:
        squared, rivals = np.square(entry["errors"]), _random_of(found, entry)
        draws = _resampled(len(squared), config["n_resamples"])
        rmse, spread = np.sqrt(squared.mean(axis=0)), np.sqrt(squared[draws].mean(axis=1))  # (resamples, counts)
        slopes = _slopes(counts, spread)
        key = {name: entry[name] for name in ("d", "pair", "p", "method")}
        for i, count in enumerate(counts):
            rows.append(key | {"L": count, "rmse": _short(rmse[i])} | _interval(spread[:, i]))
        rival_spread = np.sqrt(rivals[draws[::-1]].mean(axis=1))
        at = counts.index(RANKED_AT)
        factor = np.sqrt(rivals.mean(axis=0))[at] / rmse[at]
        savings.append(
            key
            | {"slope": _short(_slopes(counts, rmse[None])[0])}
            | {f"slope_{end}": value for end, value in _interval(slopes).items()}
            | {"factor": _short(factor)}
            | {f"factor_{end}": value for end, value in _interval(rival_spread[:, at] / spread[:, at]).items()}
        )
    return {"errors": rows, "savings": savings, "ranking": ranking(rows, counts)}


def ranking(rows: list[dict], counts: list[int]) -> list[dict]:
    """Geometric mean over problems of RMSE / RMSE of random, by dimension, method and L, sorted by L = 100.

    Translations with p = 2 are excluded, because orthogonal blocks are exact for them.
    """
    rows = [row for row in rows if (row["pair"], row["p"]) != ("translation", 2)]
    random = {_problem(row): row["rmse"] for row in rows if row["method"] == "random"}
    ratios: dict[tuple, dict[int, list]] = {}
    for row in rows:
        of_method = ratios.setdefault((row["d"], row["method"]), {})
        of_method.setdefault(row["L"], []).append(row["rmse"] / random[_problem(row)])
    found = [
        {"d": d, "method": method}
        | {f"ratio_{count}": _short(np.exp(np.log(values[count]).mean())) for count in counts}
        | {"worst_100": _short(max(values[RANKED_AT]))}
        for (d, method), values in ratios.items()
    ]
    return sorted(found, key=lambda row: (row["d"], row[f"ratio_{RANKED_AT}"]))


def _problem(row: dict) -> tuple:
    return tuple(row[name] for name in ("d", "pair", "p", "L"))


def _random_of(found: list[dict], entry: dict) -> np.ndarray:
    """Squared errors of random directions for the same problem."""
    same = [e for e in found if e["method"] == "random" and all(e[k] == entry[k] for k in ("d", "pair", "p"))]
    return np.square(same[0]["errors"])


def _resampled(n: int, n_resamples: int) -> np.ndarray:
    return np.random.default_rng(0).integers(n, size=(n_resamples, n))


def _slopes(counts: list[int], rmse: np.ndarray) -> np.ndarray:
    x = np.log(counts) - np.log(counts).mean()
    return np.log(np.maximum(rmse, 1e-16)) @ x / (x @ x)


def _interval(values: np.ndarray) -> dict:
    low, high = percentile_interval(values)
    return {"low": _short(low), "high": _short(high)}


def _short(value: float) -> float:
    """The value with four significant digits, so that the committed file stays small."""
    return float(f"{value:.4g}")


def tasks(config: dict) -> list[dict]:
    """All problems, for their means; then all combinations of problem and method."""
    problems = config["problems"]
    return problems + [problem | {"method": name} for problem in problems for name in methods(problem["d"])]


def work(task: dict, config: dict) -> dict | list:
    """The mean over all directions and its standard error; or the errors of a method relative to this mean."""
    mean, error = mean_over((task["d"], task["pair"], task["p"]), config)
    if "method" not in task:
        return {"mean": mean, "mean_error": error}
    return relative_errors(task, task["method"], mean, config).tolist()


@functools.cache
def mean_over(problem: tuple, config: dict) -> tuple[float, float]:
    """The mean over all directions and its standard error."""
    return mean_over_all(dict(zip(("d", "pair", "p"), problem, strict=True)), config)


def results(rows: list[dict], config: dict) -> dict:
    """The means, and the errors of the methods."""
    means = [row["task"] | row["found"] for row in rows if "method" not in row["task"]]
    errors = [row["task"] | {"errors": np.array(row["found"])} for row in rows if "method" in row["task"]]
    return {"means": means} | summarise(errors, config)


if __name__ == "__main__":
    experiment.run(__file__, tasks, work, results, "continuous synthetic contours and surfaces")
