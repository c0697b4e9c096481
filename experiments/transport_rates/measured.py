"""The errors of one estimator for one pair at one size, for each repetition."""

import json
import warnings
import zlib

import numpy as np
import ot
import torch
from pairs import draw_pair, known_distance, known_slices
from scipy.spatial.distance import cdist

from meshot import DiscreteMeasure, chamfer, quasi_directions
from meshot.loss import slice_costs

#: The estimated quantities. W_p and SW_p are distances (roots taken); Chamfer is squared as in the paper.
MEASURES = ("transport", "sliced", "chamfer")


def errors(task: dict, limits: list[dict], config: dict) -> dict[str, list[float]]:
    """Signed errors of a task, one per repetition, by exponent (``"1"``, ``"2"``; Chamfer has only ``"2"``)."""
    pair = {name: task[name] for name in ("shape", "d", "relation")}
    measure = {"transport": _transport, "sliced": _sliced, "chamfer": _chamfer}[task["estimate"]]
    found = []
    for repetition in range(task["n_repetitions"]):
        # One random stream per repetition: W and SW use the same samples.
        name = zlib.crc32(json.dumps([pair, task["n_points"]], sort_keys=True).encode())
        stream = [config["seed"], repetition, name]
        sample = draw_pair(pair, task["n_points"], config, np.random.default_rng(stream))
        found.append(measure(pair, *sample, limits, config))
    return {p: [float(f"{row[p]:.6g}") for row in found] for p in found[0]}


def optimal_cost(points: np.ndarray, others: np.ndarray, p: int) -> float:
    """W_p^p between equally many points of equal mass, exactly (POT's network simplex).

    For p = 2, W₂² is the squared distance of the means plus W₂² of the centred points. The latter is solved several
    times faster if the measures are far apart.
    """
    apart = 0.0
    if p == 2:
        means = points.mean(axis=0), others.mean(axis=0)
        points, others, apart = points - means[0], others - means[1], float(np.sum((means[0] - means[1]) ** 2))
    cost = cdist(points, others, "sqeuclidean" if p == 2 else "euclidean")
    with warnings.catch_warnings():
        # A solver that stops early only warns: turn the warning into an error.
        warnings.simplefilter("error")
        return float(ot.emd2([], [], cost, numItermax=10**9)) + apart


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
