"""The error over the number of random directions: root mean square over many draws, compared with √(Var/L)."""

import numpy as np
from pairs import frames, make_pair, sampled_costs
from scipy.special import gammaln
from sizes import named_slope

from meshot import random_directions
from meshot.statistics import bootstrap_interval
from meshot.types import Array, Float, Tensor
from meshot_book.statistics import fitted_slope, short

#: Length of the translation in the case "translation", along one axis, in mm.
SHIFT_MM = 12.0


def direction_runs(config: dict) -> list[dict]:
    """All cases."""
    return [{"part": "directions", "name": name} | case for name, case in config["directions"]["cases"].items()]


def direction_errors(run: dict, config: dict) -> dict:
    """Errors of the mean over L random directions against the mean over all, for many independent draws of each L."""
    settings, found = config["directions"], []
    generator = np.random.default_rng([config["seed"], 3, run["d"]])
    pools = [None] * len(config["exponents"])
    if run["case"] != "translation":
        quadrature = [_costs(run, frames(settings["n_quadrature"], run["d"], seed), config) for seed in (1, 2)]
        pools = _costs(run, random_directions(run["n_pool"], run["d"], generator), config)
    for index, (p, pool) in enumerate(zip(config["exponents"], pools)):
        if pool is None:
            moments = {"mean": translation_mean(run["d"], p), "check": None}
            moments["variance"] = translation_mean(run["d"], 2 * p) - moments["mean"] ** 2
        else:
            moments = _moments(*(costs[index] for costs in quadrature))
        rows = []
        for count in settings["counts"]:
            errors = _means(pool, count, settings["n_draws"], run["d"], p, generator) - moments["mean"]
            # To keep the file small, only means of absolute values and of squares are stored, in a hundred groups that
            # can be resampled by the bootstrap.
            groups = errors.reshape(100, -1)
            rows.append({"squares": np.square(groups).mean(axis=1).tolist()})
            rows[-1]["sizes"] = np.abs(groups).mean(axis=1).tolist()
        found.append(moments | {"p": p, "rows": rows})
    return {"exponents": found}


def _means(pool: Array | None, count: int, n_draws: int, d: int, p: float, generator: np.random.Generator) -> Array:
    """Independent means over ``count`` directions: new ones if the cost is a formula, else from the pool."""
    means = np.empty(n_draws)
    step = max(1, 500_000 // count)
    for start in range(0, n_draws, step):
        n = min(step, n_draws - start)
        if pool is None:
            gaussian = generator.standard_normal((n * count, d))
            cosines = gaussian[:, 0] / np.linalg.norm(gaussian, axis=1)
            costs = np.abs(SHIFT_MM * cosines) ** p
        else:
            costs = pool[generator.integers(len(pool), size=n * count)]
        means[start : start + n] = costs.reshape(n, count).mean(axis=1)
    return means


def translation_mean(d: int, p: float) -> float:
    """The mean over directions of |⟨θ, t⟩|^p: a moment of one coordinate of a uniform unit vector."""
    return float(SHIFT_MM**p * np.exp(gammaln(d / 2) + gammaln((p + 1) / 2) - gammaln(0.5) - gammaln((d + p) / 2)))


def _costs(run: dict, directions: Float[Tensor, "L d"], config: dict) -> list[Array]:
    """The cost along every direction, for every exponent."""
    pair = make_pair("generic", run["d"], run["subdivisions"])
    if run["case"] == "generic":
        return [pair.true_costs(directions, p) for p in config["exponents"]]
    generator = np.random.default_rng([config["seed"], 4])
    points, others = (draw(run["n_points"], generator) for draw in (pair.draw_source, pair.draw_target))
    return list(sampled_costs(points, others, directions.numpy(), config["exponents"]))


def _moments(first: Array, second: Array) -> dict:
    """Mean and variance over all directions from two quasi-random sets, and the difference between the two."""
    mean, variance = (first.mean() + second.mean()) / 2, (first.var() + second.var()) / 2
    gaps = {"mean": abs(first.mean() - second.mean()) / mean, "variance": abs(first.var() - second.var()) / variance}
    return {"mean": float(mean), "variance": float(variance), "check": {key: float(gap) for key, gap in gaps.items()}}


def direction_summary(rows: list[dict], config: dict) -> dict:
    """The summary of every case and exponent."""
    told = []
    for row in rows:
        case = {"case": row["run"]["name"], "kind": row["run"]["case"], "d": row["run"]["d"]}
        told += [case | _summary(values, config) for values in row["values"]["exponents"]]
    return {"directions": told}


def _summary(values: dict, config: dict) -> dict:
    """The slope in L of the root mean square error, and its ratio to √(Var/L) with an interval."""
    counts = config["directions"]["counts"]
    # The root mean square of the groups' root mean squares is that of all draws.
    roots = [np.sqrt(entry["squares"]) for entry in values["rows"]]
    sizes = [np.mean(entry["sizes"]) for entry in values["rows"]]
    whole = np.array([np.sqrt(np.mean(entry["squares"])) for entry in values["rows"]])
    ratios = [_ratio(root, values["variance"] / count, config["seed"]) for root, count in zip(roots, counts)]
    return (
        {"p": values["p"], "counts": counts, "mean": short(values["mean"]), "variance": short(values["variance"])}
        | {"quadrature_check": {key: short(value) for key, value in (values["check"] or {}).items()}}
        | {"rms": [short(value) for value in whole], "absolute_over_rms": [short(v) for v in sizes / whole]}
        | {
            key: [short(ratio[k]) for ratio in ratios]
            for k, key in enumerate(("constant", "constant_low", "constant_high"))
        }
        | named_slope(fitted_slope(counts, roots, "rms"))
    )


def _ratio(roots: Array, variance: float, seed: int) -> tuple[float, float, float]:
    """Root mean square over √(Var/L), with its 95 % bootstrap interval over groups of draws."""
    found = bootstrap_interval(np.square(roots), generator=np.random.default_rng([seed, 5]))
    return tuple(float(np.sqrt(square / variance)) for square in found)
