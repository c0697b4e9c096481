"""Test the axioms of a distance for every loss, and search for the worst violation."""

import itertools
import math
import sys
from pathlib import Path

import numpy as np
import ot
import torch

from meshot import (
    DiscreteMeasure,
    chamfer,
    quasi_directions,
    random_directions,
    sinkhorn_divergence,
    sliced_wasserstein,
    wasserstein,
)
from meshot_book.statistics import short

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment

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


def ghost_pair(shifts: np.ndarray) -> tuple[DiscreteMeasure, DiscreteMeasure]:
    """The sums of an even, and of an odd, number of the ``shifts`` (L, d): 2^(L−1) points each.

    Along a direction perpendicular to a shift, adding this shift does not change the projection. It pairs the points of
    one measure with those of the other, so that both have the same projection.
    """
    chosen = np.array(list(itertools.product([0, 1], repeat=len(shifts))))
    points, odd = chosen @ shifts, chosen.sum(axis=1) % 2 == 1
    return DiscreteMeasure(torch.from_numpy(points[~odd])), DiscreteMeasure(torch.from_numpy(points[odd]))


def measured(n: int, d: int, seed: int) -> dict:
    """SW₂ of such a pair over the given directions and over many others, and its W₂."""
    directions = random_directions(n, d, seed)
    helpers = random_directions(n, d, seed + 1)
    shifts = helpers - (helpers * directions).sum(dim=1, keepdim=True) * directions
    pair = ghost_pair((shifts / shifts.norm(dim=1, keepdim=True)).numpy())
    return {
        "d": d,
        "n_directions": n,
        "n_points": len(pair[0].points),
        "own": float(sliced_wasserstein(*pair, directions)) ** 0.5,
        "others": float(sliced_wasserstein(*pair, quasi_directions(1000, d))) ** 0.5,
        "w2": float(wasserstein(*pair)) ** 0.5,
    }


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
        "values": [short(value) for value in values],
        "tends_to_zero": bool(falls),
    }


def tasks(config: dict) -> list[str]:
    """A search for each loss."""
    return list(config["losses"])


def work(name: str, config: dict) -> dict:
    """The worst violations of the triangle inequality that a search finds."""
    return search(name, config["losses"][name], config)


def summarise(rows: list[dict], config: dict) -> dict:
    """The violations, pairs with equal projections, and sequences."""
    kinds = config["ghosts"]
    ghosts = [measured(n, d, config["seed"]) for d in kinds["dimensions"] for n in kinds["n_directions"]]
    rooted = {name: setting for name, setting in config["losses"].items() if setting["root"]}
    sequences = [followed(kind, name, setting, config) for kind in KINDS for name, setting in rooted.items()]
    return {"triangles": [row["found"] for row in rows], "ghosts": ghosts, "sequences": sequences}


if __name__ == "__main__":
    experiment.run(__file__, tasks, work, summarise, "drawn and constructed point measures")
