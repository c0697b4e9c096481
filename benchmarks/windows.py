"""Time of the windowed loss with its gradient, on two large cortical surfaces: ``python benchmarks/windows.py``.

128 windows with 16 directions each, between fsaverage5 and the same surface after smoothing, both with about 41 000
faces, as varifolds. Its kernels are timed beside the same windows one after the other by PyTorch. CPU seconds of this
process and wall-clock seconds, medians, are written to ``experiments/cost/windows.json``. Target: the kernels within
.25 s of wall-clock time on two idle cores.
"""

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median

import numpy as np
import torch

from meshot import Mesh, random_directions, sliced_wasserstein, varifold, windowed_sliced_wasserstein
from meshot.anatomy import fsaverage5_surface
from meshot.mesh import laplacian_smoothing, simplified, with_edges_split
from meshot.provenance import write_results
from meshot_book.notebook import table

OUTPUT = Path(__file__).resolve().parent.parent / "experiments" / "cost" / "windows.json"
RADIUS, NORMALS = 6.0, 8.0  # mm
LIMIT_S = 0.25
KERNELS, ONE_BY_ONE = "kernels", "window by window, PyTorch"


def surfaces(n_faces: int) -> tuple[Mesh, Mesh]:
    """A smoothed and the true white surface of about as many faces."""
    white = fsaverage5_surface("white", "left")
    edges = torch.cat([white.faces[:, [k, (k + 1) % 3]] for k in range(3)]).sort(dim=1).values.unique(dim=0)
    fine = with_edges_split(white, edges)
    return simplified(laplacian_smoothing(fine, 10), n_faces), simplified(fine, n_faces)


def losses(source: Mesh, target: Mesh, n_windows: int, n_directions: int) -> dict[str, Callable[[], torch.Tensor]]:
    """What is timed, by name: a value and its gradient in the vertices."""
    goal, random = varifold(target, normal_scale=NORMALS), np.random.default_rng(0)
    lines = random_directions(n_windows * n_directions, 6, random)
    centres = goal.points[random.choice(len(goal.weights), n_windows, p=goal.weights.numpy()), :3]
    sets = lines.reshape(n_windows, n_directions, 6)

    def gradient(loss: Callable) -> Callable[[], torch.Tensor]:
        def run() -> torch.Tensor:
            vertices = source.vertices.clone().requires_grad_()
            own = varifold(source.with_vertices(vertices), normal_scale=NORMALS)
            return torch.autograd.grad(loss(own), vertices)[0]

        return run

    # Windows are computed one after the other if the directions require a gradient.
    slow = sets.clone().requires_grad_()
    return {
        KERNELS: gradient(lambda own: windowed_sliced_wasserstein(own, goal, centres, RADIUS, sets, 1)),
        ONE_BY_ONE: gradient(lambda own: windowed_sliced_wasserstein(own, goal, centres, RADIUS, slow, 1)),
        f"sliced, {n_directions} directions": gradient(
            lambda own: sliced_wasserstein(own, goal, lines[:n_directions], 1)
        ),
    }


def timed(part: str, run: Callable[[], object]) -> dict:
    """CPU seconds and wall-clock seconds of one call."""
    cpu, wall = time.process_time(), time.perf_counter()
    run()
    return {"part": part, "CPU s": time.process_time() - cpu, "wall s": time.perf_counter() - wall}


def main(words: list[str] | None = None) -> int:
    """Measure, print and store the times."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--faces", type=int, default=41_000)
    parser.add_argument("--windows", type=int, default=128)
    parser.add_argument("--directions", type=int, default=16)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--repeats", type=int, default=9)
    parser.add_argument("-o", "--output", type=Path, default=OUTPUT)
    chosen = parser.parse_args(words)
    torch.set_num_threads(chosen.threads)
    started = time.perf_counter()
    pair = surfaces(chosen.faces)
    calls = losses(*pair, chosen.windows, chosen.directions)
    fast, slow = (calls[name]() for name in (KERNELS, ONE_BY_ONE))  # the first call compiles the kernels
    apart = float((fast - slow).abs().max() / slow.abs().max())
    rounds = [[timed(name, run) for name, run in calls.items()] for _ in range(chosen.repeats)]
    rows = [
        {"part": rows[0]["part"]} | {key: median(row[key] for row in rows) for key in ("CPU s", "wall s")}
        for rows in zip(*rounds, strict=True)
    ]
    n_faces = [len(mesh.faces) for mesh in pair]
    print(f"{n_faces[0]} and {n_faces[1]} faces, {chosen.threads} threads\n{table(rows, 3)}")
    print(f"both ways differ by {apart:.1g} of the largest entry of the gradient")
    config = {key: value for key, value in vars(chosen).items() if key != "output"} | {"faces": n_faces}
    target = {"what": "kernels", "found_s": rows[0]["wall s"], "limit_s": LIMIT_S, "met": rows[0]["wall s"] <= LIMIT_S}
    results = {"parts": rows, "targets": [target], "gradients_differ_by": apart}
    seconds = time.perf_counter() - started
    write_results(chosen.output, results, config, "python benchmarks/windows.py", "fsaverage5, left", seconds)
    return 0


if __name__ == "__main__":
    sys.exit(main())
