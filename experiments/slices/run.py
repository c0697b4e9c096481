"""Compare losses whose slices depend on the measures on the toy of chapter 1, after the same processor time."""

import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
from scipy import stats

from meshot import quasi_directions, random_directions, sliced_wasserstein
from meshot.loss import (
    controlled_sliced_wasserstein,
    energy_sliced_wasserstein,
    hilbert_transport,
    max_sliced_wasserstein,
    min_sliced_transport,
)
from meshot.mesh import circle, even_points, star
from meshot.types import Tensor
from meshot_book.examples import exact_distance
from meshot_book.statistics import short

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment


def loss_of(name: str, n: int, n_steps: int, generator: np.random.Generator) -> Callable[[Tensor, Tensor], Tensor]:
    """A loss that draws its lines, starts or turns anew in every call."""
    if name == "Hilbert curve":
        return lambda x, y: hilbert_transport(x, y, n, seed=generator)
    if name == "sliced, even":
        return lambda x, y: sliced_wasserstein(x, y, quasi_directions(n, 2, int(generator.integers(2**31))))
    if name == "max-sliced":
        return lambda x, y: max_sliced_wasserstein(x, y, random_directions(n, 2, generator), n_steps=n_steps)
    loss = {
        "sliced, random": sliced_wasserstein,
        "control variates": controlled_sliced_wasserstein,
        "energy-based": energy_sliced_wasserstein,
        "min-SWGG": min_sliced_transport,
    }[name]
    return lambda x, y: loss(x, y, random_directions(n, 2, generator))


def descent(name: str, n: int, learning_rate: float, seed: int, config: dict) -> dict:
    """The exact distance at the end, and the number of steps. The time of the first five steps does not count."""
    torch.set_num_threads(1)
    generator = np.random.default_rng([seed, 0])
    start, target = (
        even_points(shape, config["n_points"], offset=generator.random())
        for shape in (circle(), star(**config["star"]))
    )
    loss = loss_of(name, n, config["n_steps"], generator)
    points = start.clone().requires_grad_()
    for _ in range(5):
        torch.autograd.grad(loss(points, target), points)
    velocity, n_done, begin = torch.zeros_like(start), 0, time.process_time()
    while time.process_time() - begin < config["seconds"]:
        (gradient,) = torch.autograd.grad(loss(points, target), points)
        velocity = config["momentum"] * velocity + gradient
        points = (points.detach() - learning_rate * velocity).requires_grad_()
        n_done += 1
    end = points.detach()
    w2 = exact_distance(end, target) if bool(torch.isfinite(end).all()) else float("inf")
    return {"w2": short(min(w2, 1e6)), "n_steps": n_done, "start": short(exact_distance(start, target))}


def tasks(config: dict) -> list[list]:
    """Every loss with every number of lines, learning rate and seed."""
    return [
        [name, n, rate, seed]
        for name, numbers in config["losses"].items()
        for n in numbers
        for rate in config["learning_rates"]
        for seed in config["choice"] + config["test"]
    ]


def results(rows: list[dict], config: dict) -> dict:
    """``chosen``: of every loss, its best setting on the seeds of the choice, and how it does on those of the test."""
    runs: dict[str, dict[tuple, dict[int, dict]]] = {}
    for row in rows:
        name, n, rate, seed = row["task"]
        runs.setdefault(name, {}).setdefault((n, rate), {})[seed] = row["found"]
    chosen, first = [], None
    for name, settings in runs.items():
        best = min(settings, key=lambda s: np.mean([settings[s][seed]["w2"] for seed in config["choice"]]))
        found = [settings[best][seed] for seed in config["test"]]
        w2 = np.array([each["w2"] for each in found])
        first = w2 if first is None else first
        n, quantile = len(w2), stats.t.ppf(0.975, len(w2) - 1)
        chosen.append(
            {
                "loss": name,
                "n_lines": best[0],
                "learning_rate": best[1],
                "n_steps": short(np.mean([each["n_steps"] for each in found])),
                "w2": short(w2.mean()),
                "w2_error": short(w2.std(ddof=1) / n**0.5),
                "difference": short((w2 - first).mean()),
                "half_width": short(quantile * (w2 - first).std(ddof=1) / n**0.5),
                "n_seeds": n,
            }
        )
    start = np.mean([each["found"]["start"] for each in rows])
    return {"chosen": chosen, "start": short(start)}


if __name__ == "__main__":
    experiment.run(__file__, tasks, lambda task, config: descent(*task, config), results, "synthetic polygons")
