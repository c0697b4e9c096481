"""Weights and areas: 1D transport against other libraries, descents with and without gradients through the areas."""

import sys
from pathlib import Path

import numpy as np
import ot
import torch
from descents import DIMENSIONS, doubled, encoded, gradients_at_start, pleated_square, run_once
from scipy import stats

from meshot import quasi_directions, sliced_wasserstein
from meshot.loss import quantile_cost
from meshot.mesh import face_areas, icosphere
from meshot.provenance import rounded
from meshot_book.statistics import arm_differences, short

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment


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
        for encoding, d in DIMENSIONS.items():
            directions = quasi_directions(config["n_judging_directions"], d)
            measures = [encoded(mesh, encoding, config) for mesh in (one, other)]
            row[f"sw_{encoding}"] = float(sliced_wasserstein(*measures, directions)) ** 0.5
        rows.append(row)
    return rows


MEASURED = ("sw_surface", "sw_varifold", "assd", "edge_variation")


def summarise(rows: list[dict]) -> dict:
    """Statistics of every setting over seeds, and with minus without areas, each at its best learning rate."""
    groups: dict[str, list[dict]] = {}
    for row in rows:
        groups.setdefault(repr(row["run"]), []).append(row)
    descents = []
    for group in groups.values():
        ended = [row["values"] for row in group if not row["values"]["collapsed"]]
        found = group[0]["run"] | {"n_seeds": len(group), "n_collapsed": len(group) - len(ended)}
        for name in MEASURED if len(ended) > 1 else ():
            values = np.array([row[name] for row in ended])
            found[f"{name}_mean"], found[f"{name}_sd"] = short(values.mean()), short(values.std(ddof=1))
            found[f"{name}_seeds"] = values.tolist()
        descents.append(found)
    best: dict[tuple, dict] = {}
    for row in descents:
        key = row["target"], row["encoding"], row["detach_weights"]
        # The best rate is chosen by the run's own loss. A choice by the exact value would favour that encoding.
        own = f"sw_{row['encoding']}_mean"
        if row["n_collapsed"] == 0 and (key not in best or row[own] < best[key][own]):
            best[key] = row
    pairs = [(row, best.get((*key[:2], True))) for key, row in best.items() if not key[2]]
    return {"descents": descents, "differences": [_difference(*pair) for pair in pairs if pair[1]]}


def _difference(full: dict, stopped: dict) -> dict:
    """Paired over seeds: gradients stopped minus gradients through the areas, with the 95 % interval (Student's t)."""
    found = {"target": full["target"], "encoding": full["encoding"]}
    found |= {"rate_full": full["learning_rate"], "rate_stopped": stopped["learning_rate"]}
    arms = ({name: arm[f"{name}_seeds"] for name in MEASURED} for arm in (stopped, full))
    gaps = rounded(arm_differences(*arms))
    for name in MEASURED:
        found |= {f"{name}_full": full[f"{name}_mean"], f"{name}_stopped": stopped[f"{name}_mean"]}
        found |= {f"{name}_{end}": gaps[f"{name}_{end}"] for end in ("gap", "low", "high")}
    return found | {"n_seeds": full["n_seeds"]}


def gradient_rows(config: dict) -> list[dict]:
    """The two gradients at the start, mean and standard deviation over seeds, for every target and encoding."""
    rows = []
    for target in config["targets"]:
        for encoding in config["encodings"]:
            found = [gradients_at_start(target, encoding, seed, config) for seed in config["seeds"]]
            row = {"target": target, "encoding": encoding, "n_seeds": len(found)}
            for name in found[0]:
                values = np.array([entry[name] for entry in found])
                row[f"{name}_mean"], row[f"{name}_sd"] = short(values.mean()), short(values.std(ddof=1))
            rows.append(row)
    return rows


def tasks(config: dict) -> list[tuple[dict, int]]:
    """All settings of a descent with all seeds."""
    return [
        ({"target": target, "encoding": encoding, "detach_weights": detach, "learning_rate": rate}, seed)
        for target in config["targets"]
        for encoding in config["encodings"]
        for detach in (False, True)
        for rate in config["learning_rates"]
        for seed in config["seeds"]
    ]


def results(rows: list[dict], config: dict) -> dict:
    """The descents, and the fast parts."""
    runs = [{"run": row["task"][0], "seed": row["task"][1], "values": row["found"]} for row in rows]
    found = summarise(runs) | {"gradients": gradient_rows(config)}
    return found | {"merging": merging_errors(config["merging"]), "areas": forgotten_areas(config)}


if __name__ == "__main__":
    experiment.run(__file__, tasks, lambda task, config: run_once(*task, config), results, "synthetic surfaces")
