"""The errors of one estimate on one pair at one size, repetition by repetition."""

import json
import zlib

import numpy as np
import torch
from pairs import draw_pair, known_distance, known_slices
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from meshot import DiscreteMeasure, chamfer, quasi_directions
from meshot.loss.sliced import slice_costs

#: What is estimated. W_p and SW_p are distances, roots taken; Chamfer is squared as in the paper.
MEASURES = ("transport", "sliced", "chamfer")


def errors(task: dict, limits: list[dict], config: dict) -> dict[str, list[float]]:
    """Signed errors of a task, one for each repetition, by exponent (``"1"``, ``"2"``; Chamfer knows only ``"2"``)."""
    pair = {name: task[name] for name in ("shape", "d", "relation")}
    measure = {"transport": _transport, "sliced": _sliced, "chamfer": _chamfer}[task["estimate"]]
    found = []
    for repetition in range(task["n_repetitions"]):
        # One stream for each repetition: W and SW see the same samples.
        name = zlib.crc32(json.dumps([pair, task["n_points"]], sort_keys=True).encode())
        stream = [config["seed"], repetition, name]
        sample = draw_pair(pair, task["n_points"], config, np.random.default_rng(stream))
        found.append(measure(pair, *sample, limits, config))
    return {p: [float(f"{row[p]:.6g}") for row in found] for p in found[0]}


def optimal_cost(points: np.ndarray, others: np.ndarray, p: int) -> float:
    """W_p^p between equally many points of equal mass, exactly, as an assignment (SciPy)."""
    cost = cdist(points, others, "sqeuclidean" if p == 2 else "euclidean")
    return float(cost[linear_sum_assignment(cost)].mean())


def _transport(pair: dict, points: np.ndarray, others: np.ndarray, _: list, config: dict) -> dict[str, float]:
    found = {}
    for p in config["exponents"]:
        cost = optimal_cost(points, others, p)
        found[str(p)] = cost ** (1 / p) - known_distance(pair, config)
    return found


def _sliced(pair: dict, points: np.ndarray, others: np.ndarray, _: list, config: dict) -> dict[str, float]:
    directions = quasi_directions(config["sliced"]["n_directions"], pair["d"], config["seed"])
    source, target = (DiscreteMeasure(torch.from_numpy(side)) for side in (points, others))
    found = {}
    for p in config["exponents"]:
        cost = float(slice_costs(source, target, directions, p).mean())
        exact = float(known_slices(pair, config, directions.numpy(), p).mean())
        found[str(p)] = cost ** (1 / p) - exact ** (1 / p)
    return found


def _chamfer(pair: dict, points: np.ndarray, others: np.ndarray, limits: list, _: dict) -> dict[str, float]:
    (limit,) = [row["limit"] for row in limits if all(row[name] == value for name, value in pair.items())]
    source, target = (DiscreteMeasure(torch.from_numpy(side)) for side in (points, others))
    return {"2": float(chamfer(source, target)) - limit}
