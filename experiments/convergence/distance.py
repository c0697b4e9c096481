"""The constant in the theorem: two spheres at increasing distance, with everything else fixed."""

import numpy as np
from pairs import frames, sampled_costs, spheres
from sizes import named_slope, short

from meshot.statistics import percentile_interval
from meshot_book.statistics import averages, fitted_slope


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
