"""The error over the number of points: both measures are sampled; directions are the same as for the exact value."""

import functools

import numpy as np
from pairs import frames, make_pair, sampled_costs, spheres

from meshot.statistics import percentile_interval
from meshot.types import Array
from meshot_book.statistics import averages, fitted_slope, short


def size_runs(config: dict) -> list[dict]:
    """All combinations of pair and number of points."""
    settings, runs = config["sizes"], []
    for name, pair in settings["pairs"].items():
        counts = [(n_points, settings["n_repetitions"]) for n_points in settings["points"]]
        if pair.get("to_largest"):
            counts.append(tuple(settings["largest"].values()))
        runs += [{"part": "sizes", "name": name} | pair | {"n_points": m, "n_repetitions": n} for m, n in counts]
    return runs


@functools.cache
def _truth(pair: str, d: int, n_directions: int, seed: int, exponents: tuple) -> tuple[Array, Array]:
    directions = frames(n_directions, d, seed)
    known = make_pair(pair, d)
    return directions.numpy(), np.array([known.true_costs(directions, p).mean() for p in exponents])


def size_errors(run: dict, config: dict) -> dict:
    """Sampled minus exact SW_p^p: for each exponent a list over repetitions with independent random numbers."""
    exponents = config["exponents"]
    pair = make_pair(run["pair"], run["d"])
    directions, truth = _truth(run["pair"], run["d"], run["n_directions"], config["seed"], tuple(exponents))
    errors = []
    for repetition in range(run["n_repetitions"]):
        generator = np.random.default_rng([config["seed"], run["n_points"], repetition])
        points = pair.draw_source(run["n_points"], generator)
        others = pair.draw_target(run["n_points"], generator)
        errors.append(sampled_costs(points, others, directions, exponents).mean(axis=1) - truth)
    return {"errors": np.transpose(errors).tolist(), "truth": truth.tolist()}


def size_summary(rows: list[dict], config: dict) -> dict:
    """Mean errors and slopes for every pair and exponent, and the error over the dimension for every family."""
    slopes, at_one_size = [], {}
    for name, pair in config["sizes"]["pairs"].items():
        found = [row for row in rows if row["run"]["name"] == name]
        (at_one_size[name],) = [row for row in found if row["run"]["n_points"] == config["dimension"]["points"]]
        for index, p in enumerate(config["exponents"]):
            slopes.append({"pair": name, "d": pair["d"], "p": p} | _slopes(found, index))
    over = [
        {"family": family, "p": p} | _over_dimension([at_one_size[name] for name in names], index)
        for family, names in config["dimension"]["families"].items()
        for index, p in enumerate(config["exponents"])
    ]
    return {"sizes": slopes, "dimension": over}


def _slopes(found: list[dict], index: int) -> dict:
    counts = [row["run"]["n_points"] for row in found]
    errors = [row["values"]["errors"][index] for row in found]
    half = len(counts) // 2
    means = averages(errors)
    whole, upper = fitted_slope(counts, errors), fitted_slope(counts[half:], errors[half:])
    # The bound sqrt(log m / m) is not an exact power law. Its slope over the same sizes is used for comparison.
    bound = fitted_slope(counts, [[np.sqrt(np.log(m) / m)] * len(e) for m, e in zip(counts, errors)], n_draws=2).slope
    return (
        {
            "truth": short(found[0]["values"]["truth"][index]),
            "points": counts,
            "n_repetitions": [len(row) for row in errors],
            "error": [short(value) for value in means],
            "error_sd": [short(np.abs(row).std(ddof=1)) for row in errors],
            "bias": [short(np.mean(row)) for row in errors],
            "bound_slope": short(bound),
        }
        | named_slope(whole)
        | named_slope(upper, "upper_")
    )


def _over_dimension(found: list[dict], index: int) -> dict:
    """Slopes of the error in d, and of the error relative to the true value if that is not zero."""
    dimensions = [row["run"]["d"] for row in found]
    errors = [row["values"]["errors"][index] for row in found]
    truths = [row["values"]["truth"][index] for row in found]
    # The slope of √(d + 1) over the same dimensions.
    bound = fitted_slope(dimensions, [[np.sqrt(d + 1)] * 2 for d in dimensions], n_draws=2).slope
    row = {"d": dimensions, "error": [short(value) for value in averages(errors)], "bound_slope": short(bound)}
    row |= named_slope(fitted_slope(dimensions, errors))
    if min(truths) > 1e-9:
        relative = [np.array(error) / truth for error, truth in zip(errors, truths)]
        row |= {"relative": [short(value) for value in averages(relative)]}
        row |= named_slope(fitted_slope(dimensions, relative), "relative_")
    return row


def named_slope(found: tuple[float, float, float], prefix: str = "") -> dict:
    """A slope and its interval as entries of a row."""
    return {f"{prefix}{key}": short(value) for key, value in zip(("slope", "low", "high"), found)}


def distance_runs(config: dict) -> list[dict]:
    """All combinations of number of points and distance between the centres."""
    settings = config["distance"]
    return [
        {"part": "distance", "n_points": m, "apart": apart} for m in settings["points"] for apart in settings["apart"]
    ]


def distance_errors(run: dict, config: dict) -> dict:
    """Sampled minus true SW_p^p for every exponent and repetition, with the same draws at every distance."""
    settings = config["distance"]
    exponents, directions = settings["exponents"], frames(settings["n_directions"], 3, config["seed"])
    pair = spheres(*settings["radii"], run["apart"])
    truth = np.array([pair.true_costs(directions, p).mean() for p in exponents])
    errors = []
    for repetition in range(settings["n_repetitions"]):
        generator = np.random.default_rng([config["seed"], 6, repetition])
        points, others = pair.draw_source(run["n_points"], generator), pair.draw_target(run["n_points"], generator)
        errors.append(sampled_costs(points, others, directions.numpy(), exponents).mean(axis=1) - truth)
    return {"errors": np.transpose(errors).tolist(), "truth": truth.tolist()}


def distance_summary(rows: list[dict], config: dict) -> dict:
    """Mean errors over the distance, their ratio to the concentric case with an interval, and the slope far away."""
    settings, found = config["distance"], []
    for n_points in settings["points"]:
        same = [row for row in rows if row["run"]["n_points"] == n_points]
        for index, p in enumerate(settings["exponents"]):
            errors = np.abs([row["values"]["errors"][index] for row in same])
            # Draws are shared between distances, so that repetitions are resampled jointly.
            pick = np.random.default_rng([config["seed"], 7]).integers(errors.shape[1], size=(2000, errors.shape[1]))
            means = errors[:, pick].mean(axis=2)
            low, high = percentile_interval(means / means[0])
            found.append(
                {"n_points": n_points, "p": p, "apart": settings["apart"]}
                | {"error": [short(value) for value in averages(errors)]}
                | {
                    "sharper": [
                        short(sharper_bound(settings["radii"], apart, n_points, p)) for apart in settings["apart"]
                    ]
                }
                | {"truth": [short(row["values"]["truth"][index]) for row in same]}
                | {"ratio": [short(value) for value in errors.mean(axis=1) / errors[0].mean()]}
                | {"ratio_low": [short(value) for value in low], "ratio_high": [short(value) for value in high]}
                | named_slope(fitted_slope(settings["apart"][2:], errors[2:]))
            )
    return {"distance": found}


def sharper_bound(radii: list[float], apart: float, n_points: int, p: float) -> float:
    """p·D^(p−1)·(R₁ + R₂)/(2√m) for two spheres: R are their diameters and D is the diameter of their union."""
    joint = max(2 * max(radii), apart + sum(radii))
    return p * joint ** (p - 1) * 2 * sum(radii) / (2 * n_points**0.5)
