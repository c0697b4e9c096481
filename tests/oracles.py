"""Slow twins, obviously right: loops and definitions instead of cleverness."""

import numpy as np
import ot
import torch

from meshot.loss.sliced import plain_sliced_wasserstein
from meshot.measure.discrete import DiscreteMeasure


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


def windowed_sliced_wasserstein(source, target, centres, radius: float, directions, p: float):
    """The definition, a window at a time, as a tensor: weights by a Gaussian without gradient, then plain transport."""
    costs = []
    for centre, lines in zip(centres, directions, strict=True):
        sides = []
        for measure in (source, target):
            squared = ((measure.points.detach()[:, : len(centre)] - centre) ** 2).sum(dim=1)
            shares = measure.weights * torch.where(
                squared.sqrt() < 2.5 * radius, torch.exp(-squared / 2 / radius**2), 0.0
            )
            sides.append((measure.points, shares))
        if all(float(shares.detach().sum()) > 0 for _, shares in sides):
            seen = [DiscreteMeasure(points, shares / shares.sum()) for points, shares in sides]
            costs.append(plain_sliced_wasserstein(*seen, lines, p))
    return torch.stack(costs).mean()
