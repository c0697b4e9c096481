"""How long the ruler takes, part by part, on two large surfaces: ``python benchmarks/ruler.py``.

CPU seconds of this process, which other work on the machine changes little, beside seconds of the wall. Everything but
the earth mover's distance is to stay within 8 s of the wall on two idle cores at 300 000 faces and 100 000 points.
"""

import argparse
import time
import warnings
from collections.abc import Callable

import torch

from meshot.mesh.shapes import folded_sphere
from meshot.metrics import evaluate as ruler
from meshot.metrics.evaluate import evaluate
from meshot.metrics.surface import Surface
from meshot.metrics.transport import earth_movers_distance, sliced_distance
from meshot.report.numbers import table


def timed(part: str, call: Callable[[], object]) -> dict:
    """One call, in CPU seconds and seconds of the wall."""
    cpu, wall = time.process_time(), time.perf_counter()
    call()
    return {"part": part, "CPU s": time.process_time() - cpu, "wall s": time.perf_counter() - wall}


def measured(subdivisions: int, n_points: int, emd_sizes: list[int]) -> list[dict]:
    """The parts of an evaluation, the whole without EMD (one point for it), and EMD alone at several sizes."""
    predicted, target = folded_sphere(subdivisions, depth=6.2), folded_sphere(subdivisions)
    surface = Surface(target)
    one, other = surface.sample(n_points, 0), surface.sample(n_points, 1)
    rows = [
        timed("search tree", lambda: Surface(predicted)),
        timed("sample", lambda: surface.sample(n_points, 2)),
        timed("points to faces, one side", lambda: surface.offsets(one)),
        timed("SWD", lambda: sliced_distance(one.points, other.points)),
        timed("self-intersection, topology, triangles", lambda: ruler._of_the_mesh(predicted)),
        timed("all but EMD, floors included", lambda: evaluate(predicted, target, n_points, n_emd_points=1)),
    ]
    for n in emd_sizes:
        rows.append(timed(f"EMD, {n} points", lambda n=n: earth_movers_distance(one.points[:n], other.points[:n])))
    return rows


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--subdivisions", type=int, default=7, help="7 makes 327 680 faces (default: %(default)s)")
    parser.add_argument("--points", type=int, default=100_000)
    parser.add_argument("--emd-points", type=int, nargs="*", default=[2000, 5000, 10_000])
    parser.add_argument("--threads", type=int, default=2)
    chosen = parser.parse_args()
    torch.set_num_threads(chosen.threads)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        rows = measured(chosen.subdivisions, chosen.points, chosen.emd_points)
    print(f"{20 * 4**chosen.subdivisions} faces, {chosen.points} points, {chosen.threads} threads\n{table(rows, 3)}")


if __name__ == "__main__":
    main()
