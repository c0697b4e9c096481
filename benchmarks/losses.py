"""How long a loss and its gradient take, side by side in one process: ours, POT, k-d-tree Chamfer, and bare sorting.

Run on an otherwise idle machine::

    python benchmarks/losses.py

prints a table and writes ``benchmarks/losses.json``. Weighted measures on folded surfaces, points in R³ and points with
normals in R⁶, the same directions for all, float64, two threads; every peer in turn, several rounds, medians.
"""

import argparse
import statistics
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import ot
import torch
from tqdm import tqdm

from meshot import DiscreteMeasure, chamfer, random_directions, sliced_wasserstein
from meshot.mesh.geometry import face_normals
from meshot.mesh.mesh import Mesh
from meshot.mesh.sampling import sample_locations
from meshot.mesh.shapes import folded_sphere
from meshot.report.numbers import table
from meshot.report.results import write_results
from meshot.threads import in_chunks

CONFIG = {
    "sizes": [10_000, 100_000],
    "dimensions": [3, 6],
    "n_directions": 100,
    "n_rounds": 5,
    "n_threads": 2,
    "seed": 0,
}
OURS = "fused"


def surface_measure(mesh: Mesh, n: int, d: int, seed: int) -> DiscreteMeasure:
    """Points of a surface, with normals scaled to 10 mm if d is 6, and random weights."""
    cells, barycentric = sample_locations(mesh, n, seed)
    points = (barycentric[:, :, None] * mesh.vertices[mesh.faces[cells]]).sum(dim=1)
    if d == 6:
        points = torch.cat([points, 10 * face_normals(mesh)[cells]], dim=1)
    weights = torch.from_numpy(np.random.default_rng(seed).uniform(0.5, 1.5, n))
    return DiscreteMeasure(points, weights / weights.sum())


def peers(source: DiscreteMeasure, target: DiscreteMeasure, directions: torch.Tensor) -> dict[str, Callable[[], None]]:
    """What is timed: each makes a value and its gradient in the points and weights of the source."""
    x, a = source.points.requires_grad_(), source.weights.requires_grad_()

    def with_gradient(loss: Callable[[], torch.Tensor]) -> Callable[[], None]:
        return lambda: torch.autograd.grad(loss(), (x, a))

    def pot() -> torch.Tensor:
        distance = ot.sliced.sliced_wasserstein_distance
        return distance(x, target.points, a, target.weights, projections=directions.T) ** 2

    lines = directions.numpy()
    sides = [points.detach().numpy() for points in (x, target.points)]

    def bare_sorting() -> None:
        projected = [np.ascontiguousarray(lines @ side.T) for side in sides]
        started = time.perf_counter()
        in_chunks(lambda i, j: [np.argsort(side[i:j], axis=1) for side in projected], len(lines))
        bare_sorting.seconds = time.perf_counter() - started

    return {
        OURS: with_gradient(lambda: sliced_wasserstein(source, target, directions)),
        "np.argsort of both sides": bare_sorting,
        "k-d-tree Chamfer": with_gradient(lambda: chamfer(source, target)),
        "POT": with_gradient(pot),
    }


def timed(call: Callable[[], None]) -> float:
    """Seconds of one call; of the sorting alone where the call says so itself."""
    started = time.perf_counter()
    call()
    return getattr(call, "seconds", time.perf_counter() - started)


def compare(n: int, d: int, config: dict, progress: tqdm) -> dict:
    """Median seconds of every peer, round by round so that all see the same disturbances."""
    measures = [
        surface_measure(folded_sphere(6, depth=depth), n, d, config["seed"] + i) for i, depth in enumerate((4.0, 8.0))
    ]
    calls = peers(*measures, random_directions(config["n_directions"], d, config["seed"]))
    seconds: dict[str, list[float]] = {name: [] for name in calls}
    for turn in range(config["n_rounds"] + 1):
        for name, call in calls.items():
            elapsed = timed(call)
            progress.update()
            if turn:  # the first turn compiles and warms up
                seconds[name].append(elapsed)
    medians = {name: statistics.median(times) for name, times in seconds.items()}
    return {
        "n": n,
        "d": d,
        "seconds": medians,
        "spread": {name: [min(times), max(times)] for name, times in seconds.items()},
        "ratio_to_fused": {name: median / medians[OURS] for name, median in medians.items()},
    }


def main() -> None:
    """Run, print, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--output", type=Path, default=Path(__file__).parent / "losses.json")
    parser.add_argument("--sizes", type=int, nargs="+", default=CONFIG["sizes"])
    parser.add_argument("--rounds", type=int, default=CONFIG["n_rounds"])
    arguments = parser.parse_args()
    config = CONFIG | {"sizes": arguments.sizes, "n_rounds": arguments.rounds}
    torch.set_num_threads(config["n_threads"])
    started = time.perf_counter()
    cases = [(n, d) for n in config["sizes"] for d in config["dimensions"]]
    with tqdm(total=4 * (config["n_rounds"] + 1) * len(cases), unit="call") as progress:
        results = [compare(n, d, config, progress) for n, d in cases]
    rows = [
        {
            "n": r["n"],
            "d": r["d"],
            "peer": name,
            "seconds": r["seconds"][name],
            "times fused": r["ratio_to_fused"][name],
        }
        for r in results
        for name in r["seconds"]
    ]
    print(table(rows))
    seconds = time.perf_counter() - started
    write_results(
        arguments.output, {"cases": results}, config, "python benchmarks/losses.py", "folded spheres, sampled", seconds
    )


if __name__ == "__main__":
    main()
