"""Slow twins, obviously right: loops and definitions instead of cleverness."""

import numpy as np
import ot


def chamfer(source: np.ndarray, target: np.ndarray, source_weights: np.ndarray, target_weights: np.ndarray) -> float:
    """Equation 1 by two loops."""
    forward = sum(w * min(((x - y) ** 2).sum() for y in target) for x, w in zip(source, source_weights, strict=True))
    backward = sum(w * min(((x - y) ** 2).sum() for x in source) for y, w in zip(target, target_weights, strict=True))
    return float(forward + backward)


def sliced_wasserstein(source, target, directions: np.ndarray, p: float) -> float:
    """The mean over directions of POT's transport on a line."""
    costs = []
    for theta in directions:
        x, y = source.points.numpy() @ theta, target.points.numpy() @ theta
        costs.append(ot.emd2_1d(x, y, source.weights.numpy(), target.weights.numpy(), metric="minkowski", p=p))
    return float(np.mean(costs))
