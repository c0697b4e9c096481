"""Search for violations of the triangle inequality: random triples, then local search from the worst one."""

import numpy as np
from losses import Measures, measure, sides

from meshot import sinkhorn_divergence

LEAST_WEIGHT = 1e-4


def search(name: str, setting: dict, config: dict) -> dict:
    """The frequency of violations among random triples, and the worst triple that was found."""
    generator = np.random.default_rng(config["seed"])
    triples = _drawn(generator, config["n_triples"], config["n_points"])
    ratios = longest_share(sides(triples, setting, config))
    best = [tuple(part[ratios.argmax()] for part in side) for side in triples]
    worst = _rounded(_climbed(best, setting, config, generator))
    lengths = sides([(x[None], w[None]) for x, w in worst], setting, config, config["n_iterations_check"])
    return {
        "loss": name,
        "root": setting["root"],
        "n_triples": config["n_triples"],
        "n_broken": int((ratios > 1 + config["tolerance"]).sum()),
        "largest_drawn": float(ratios.max()),
        "largest_found": float(longest_share(lengths)[0]),
        "sides": [float(side) for side in lengths[:, 0]],
        "triple": [{"points": x.tolist(), "weights": w.tolist()} for x, w in worst],
    } | _by_package(worst, setting)


def longest_share(lengths: np.ndarray) -> np.ndarray:
    """The longest side divided by the sum of the two others. Above one, the triangle inequality is violated."""
    longest = lengths.max(axis=0)
    return longest / np.maximum(lengths.sum(axis=0) - longest, 1e-12)


def _drawn(generator: np.random.Generator, n: int, n_points: int) -> list[Measures]:
    return [
        (generator.normal(size=(n, n_points, 2)), _normalised(generator.random((n, n_points)) + 0.02)) for _ in range(3)
    ]


def _normalised(weights: np.ndarray) -> np.ndarray:
    weights = np.maximum(weights / weights.sum(axis=-1, keepdims=True), LEAST_WEIGHT)
    return weights / weights.sum(axis=-1, keepdims=True)


def _climbed(best: list[Measures], setting: dict, config: dict, generator: np.random.Generator) -> list[Measures]:
    """Local search: repeatedly the best of many nearby triples, at decreasing distance; the current one is included."""
    for step in range(config["n_climbs"]):
        size, shape = 0.5 * 0.97**step, (config["n_neighbours"], config["n_points"])
        nearby = []
        for x, w in best:
            moves, gains = generator.normal(size=(*shape, 2)), generator.normal(size=shape)
            moves[0], gains[0] = 0, 0
            nearby.append((x + size * moves, _normalised(w * np.exp(size * gains))))
        chosen = longest_share(sides(nearby, setting, config)).argmax()
        best = [(x[chosen], w[chosen]) for x, w in nearby]
    return best


def _rounded(triple: list[Measures]) -> list[Measures]:
    """Coordinates and weights rounded for printing. The last weight compensates for rounding."""
    found = []
    for x, w in triple:
        weights = np.round(w, 4)
        weights[weights.argmax()] += 1 - weights.sum()
        found.append((np.round(x, 4), np.round(weights, 10)))
    return found


def _by_package(triple: list[Measures], setting: dict) -> dict:
    """For Sinkhorn, the same ratio computed with ``meshot.sinkhorn_divergence`` and slow annealing."""
    if setting["kind"] != "sinkhorn":
        return {}
    a, b, c = (measure(x, w) for x, w in triple)
    values = [
        float(sinkhorn_divergence(*pair, setting["p"], setting["blur"], 0.99)) for pair in ((a, b), (b, c), (a, c))
    ]
    root = 1 / setting["p"] if setting["root"] else 1
    return {"largest_by_package": float(longest_share(np.maximum(values, 0)[:, None] ** root)[0])}
