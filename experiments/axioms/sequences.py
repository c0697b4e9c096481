"""Sequences of measures that converge weakly, or do not, and the values of each loss along them."""

import math

import torch
from losses import loss

from meshot import DiscreteMeasure, sinkhorn_divergence

#: For each name: whether the sequence converges weakly to its target, and whether it is bounded.
KINDS = {
    "a point approaches the target": (True, True),
    "a far point loses its mass": (True, True),
    "an even row gets finer": (True, True),
    "a far point keeps the wrong mass": (False, True),
    "a point loses mass and moves away": (True, False),
}


def pair(name: str, k: int) -> tuple[DiscreteMeasure, DiscreteMeasure]:
    """The k-th measure of a sequence, and its target."""
    origin = _on_axis([0.0])
    light = [1 - 1 / k, 1 / k]
    if name == "a point approaches the target":
        return _on_axis([1 / k]), origin
    if name == "a far point loses its mass":
        return _on_axis([0.0, 1.0], light), origin
    if name == "an even row gets finer":
        fine = 1024
        return _on_axis([(i + 0.5) / k for i in range(k)]), _on_axis([(i + 0.5) / fine for i in range(fine)])
    if name == "a far point keeps the wrong mass":
        return _on_axis([0.0, 1.0], light), _on_axis([0.0, 1.0])
    return _on_axis([0.0, math.sqrt(k)], light), origin


def _on_axis(places: list[float], weights: list[float] | None = None) -> DiscreteMeasure:
    points = torch.tensor([[x, 0.0] for x in places], dtype=torch.float64)
    return DiscreteMeasure(points, None if weights is None else torch.tensor(weights, dtype=torch.float64))


def followed(name: str, title: str, setting: dict, config: dict) -> dict:
    """The p-th root of a loss along a sequence, and whether it converges to zero."""
    values = []
    for k in config["sequence"]:
        source, target = pair(name, k)
        if setting["kind"] == "sinkhorn":
            value = max(float(sinkhorn_divergence(source, target, setting["p"], setting["blur"], 0.9)), 0.0)
        else:
            value = loss(source, target, setting, config)
        values.append(value ** (1 / setting["p"]))
    falls = values[-1] <= max(config["falls_to"] * values[0], 1e-9)
    weakly, bounded = KINDS[name]
    return {
        "sequence": name,
        "converges_weakly": weakly,
        "bounded": bounded,
        "loss": title,
        "values": [float(f"{value:.6g}") for value in values],
        "tends_to_zero": bool(falls),
    }
