"""The losses on batches of pairs of small measures, and a Sinkhorn divergence iterated to convergence."""

import numpy as np
import ot
import torch

from meshot import DiscreteMeasure, chamfer, quasi_directions, sliced_wasserstein

Measures = tuple[np.ndarray, np.ndarray]  # points (batch, n, 2), weights (batch, n)


def measure(points: np.ndarray, weights: np.ndarray) -> DiscreteMeasure:
    """One element of a batch as a measure of the package."""
    return DiscreteMeasure(
        torch.from_numpy(np.ascontiguousarray(points)), torch.from_numpy(np.ascontiguousarray(weights))
    )


def sides(triples: list[Measures], setting: dict, config: dict, n_iterations: int | None = None) -> np.ndarray:
    """The losses between first and second, second and third, first and third measure: shape (3, batch)."""
    pairs = ((0, 1), (1, 2), (0, 2))
    if setting["kind"] == "sinkhorn":
        values = _divergences(triples, pairs, setting["p"], setting["blur"], n_iterations or config["n_iterations"])
    else:
        values = np.array([_one_by_one(triples[i], triples[j], setting, config) for i, j in pairs])
    return values ** (1 / setting["p"]) if setting["root"] else values


def _one_by_one(source: Measures, target: Measures, setting: dict, config: dict) -> list[float]:
    return [loss(measure(*s), measure(*t), setting, config) for s, t in zip(zip(*source), zip(*target), strict=True)]


def loss(source: DiscreteMeasure, target: DiscreteMeasure, setting: dict, config: dict) -> float:
    """W_p^p, SW_p^p or Chamfer of one pair."""
    p = setting["p"]
    if setting["kind"] == "sliced":
        directions = quasi_directions(config["n_directions"], source.points.shape[1])
        return float(sliced_wasserstein(source, target, directions, p))
    if setting["kind"] == "transport":
        cost = torch.cdist(source.points, target.points, compute_mode="donot_use_mm_for_euclid_dist").pow(p).numpy()
        return max(float(ot.emd2(source.weights.numpy(), target.weights.numpy(), cost)), 0.0)
    return float(chamfer(source, target))


def _divergences(triples: list[Measures], pairs: tuple, p: int, blur: float, n_iterations: int) -> np.ndarray:
    own = [_entropic_cost(side, side, p, blur, n_iterations) for side in triples]
    cross = [_entropic_cost(triples[i], triples[j], p, blur, n_iterations) - (own[i] + own[j]) / 2 for i, j in pairs]
    return np.maximum(cross, 0)


def _entropic_cost(source: Measures, target: Measures, p: int, blur: float, n_iterations: int) -> np.ndarray:
    """OT_ε by Sinkhorn's iteration in the logarithmic domain, with the conventions of ``sinkhorn_divergence``."""
    (x, a), (y, b), epsilon = source, target, blur**p
    cost = np.linalg.norm(x[:, :, None] - y[:, None], axis=3) ** p / p
    f, g = np.zeros_like(a), np.zeros_like(b)
    for _ in range(n_iterations):
        f = -epsilon * _soft_maximum((g[:, None] - cost) / epsilon + np.log(b)[:, None], 2)
        g = -epsilon * _soft_maximum((f[:, :, None] - cost) / epsilon + np.log(a)[:, :, None], 1)
    return p * ((f * a).sum(axis=1) + (g * b).sum(axis=1))


def _soft_maximum(values: np.ndarray, axis: int) -> np.ndarray:
    top = values.max(axis=axis, keepdims=True)
    return np.log(np.exp(values - top).sum(axis=axis)) + np.squeeze(top, axis)
