"""Time of the windowed loss: its kernels, and the same windows one after the other.

Run on an otherwise idle machine::

    python benchmarks/windows.py

Both compute 128 windows with 16 directions between the initial and the true surface of a held-out subject, as
varifolds, with the gradient in the vertices. Each round runs both; the medians of processor time and of time are
printed.
"""

import argparse
import time
from collections.abc import Callable
from statistics import median
from unittest import mock

import numpy as np
import torch

from meshot import Mesh, random_directions, varifold, windowed_sliced_wasserstein
from meshot.systems.deformation import read_example
from meshot_book.notebook import experiment_folder, table

N_WINDOWS, N_DIRECTIONS, RADIUS, NORMALS = 128, 16, 6.0, 8.0


def problem() -> Callable[[], torch.Tensor]:
    """A function that computes the loss and its gradient."""
    subject, _ = read_example(experiment_folder("ddot") / "held_out.safetensors")
    source, target = subject.initial, varifold(subject.target, normal_scale=NORMALS)
    print(f"{len(source.faces)} and {len(subject.target.faces)} faces, {source.vertices.dtype}")
    random = np.random.default_rng(0)
    lines = random_directions(N_WINDOWS * N_DIRECTIONS, 6, random).to(target.points)
    at = random.integers(len(target.weights), size=N_WINDOWS)
    centres, lines = target.points[at, :3], lines.reshape(N_WINDOWS, N_DIRECTIONS, 6)

    def run() -> torch.Tensor:
        vertices = source.vertices.clone().requires_grad_()
        own = varifold(Mesh(vertices, source.faces), normal_scale=NORMALS)
        value = windowed_sliced_wasserstein(own, target, centres, RADIUS, lines, 1)
        return torch.autograd.grad(value, vertices)[0]

    return run


def timed(run: Callable[[], torch.Tensor]) -> tuple[float, float]:
    """Seconds of processor time and of time."""
    before = time.process_time(), time.perf_counter()
    run()
    return time.process_time() - before[0], time.perf_counter() - before[1]


def main() -> None:
    """Print a table of medians."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--threads", type=int, default=2)
    arguments = parser.parse_args()
    torch.set_num_threads(arguments.threads)
    run = problem()
    one_by_one = mock.patch("meshot.loss.windowed.takes_kernel", return_value=False)
    found = {"kernels": [], "one by one": []}
    reference = run()
    with one_by_one:
        apart = float((run() - reference).abs().max() / reference.abs().max())
    for _ in range(arguments.rounds):
        found["kernels"].append(timed(run))
        with one_by_one:
            found["one by one"].append(timed(run))
    rows = [
        {"way": name, "processor (s)": median(x for x, _ in times), "time (s)": median(x for _, x in times)}
        for name, times in found.items()
    ]
    print(table(rows, n_digits=3))
    ratios = [slow[0] / fast[0] for fast, slow in zip(found["kernels"], found["one by one"])]
    print(f"ratio of processor times: {median(ratios):.3g}; gradients differ by {apart:.1g} of the largest entry")


if __name__ == "__main__":
    main()
