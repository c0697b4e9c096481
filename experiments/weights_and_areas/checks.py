"""Checks without a descent: 1D transport against other libraries, and pairs with equal normalised areas."""

import numpy as np
import ot
import torch
from descents import DIMENSIONS, encoded
from meshes import doubled, pleated_square
from scipy import stats

from meshot import Mesh, quasi_directions, sliced_wasserstein
from meshot.loss import quantile_cost
from meshot.mesh import face_areas, icosphere


def drawn_case(settings: dict, generator: np.random.Generator) -> tuple[np.ndarray, ...]:
    """Random points and weights on a line for both sides, with ties, zero weights, and measures of one point."""
    sides = []
    for _ in range(2):
        n = int(generator.integers(1, settings["largest"] + 1))
        points = generator.normal(size=n).round(int(generator.integers(1, 9)))
        weights = generator.random(n) * (generator.random(n) > 0.2)
        weights[generator.integers(n)] += 0.1
        sides += [points, weights / weights.sum()]
    return tuple(sides)


def merging_errors(settings: dict) -> list[dict]:
    """For every exponent the largest difference from POT (sorting, linear programming) and SciPy."""
    rows = []
    for p in settings["exponents"]:
        generator = np.random.default_rng(0)
        errors: dict[str, list[float]] = {"pot_sorting": [], "pot_linear_program": [], "scipy": []}
        for _ in range(settings["n_cases"]):
            x, a, y, b = drawn_case(settings, generator)
            tensors = [torch.from_numpy(v) for v in (x[None], a, y[None], b)]
            ours = float(quantile_cost(*tensors, p))
            errors["pot_sorting"].append(abs(ours - float(ot.emd2_1d(x, y, a, b, metric="minkowski", p=p))))
            cost = np.abs(x[:, None] - y[None]) ** p
            errors["pot_linear_program"].append(abs(ours - float(ot.emd2(a, b, cost))))
            if p == 1:
                errors["scipy"].append(abs(ours - stats.wasserstein_distance(x, y, a, b)))
        rows.append({"p": p, "n_cases": settings["n_cases"]} | {k: max(v) for k, v in errors.items() if v})
    return rows


def forgotten_areas(config: dict) -> list[dict]:
    """Pairs of surfaces of different area: the ratio of the areas, and the distance under each encoding."""
    sphere, flat = icosphere(3), pleated_square(config["pleats"]["counts"][0], 0.0)
    pairs = {"a sphere covered twice": (sphere, doubled(sphere))}
    for count in config["pleats"]["counts"]:
        pairs[f"a square with {count} pleats"] = (flat, pleated_square(count, config["pleats"]["slope"]))
    rows = []
    for name, (one, other) in pairs.items():
        row = {"surface": name, "area_ratio": float(face_areas(other).sum() / face_areas(one).sum())}
        rows.append(row | {f"sw_{encoding}": _apart(one, other, encoding, config) for encoding in DIMENSIONS})
    return rows


def _apart(one: Mesh, other: Mesh, encoding: str, config: dict) -> float:
    directions = quasi_directions(config["n_judging_directions"], DIMENSIONS[encoding])
    measures = [encoded(mesh, encoding, config) for mesh in (one, other)]
    return float(sliced_wasserstein(*measures, directions)) ** 0.5
