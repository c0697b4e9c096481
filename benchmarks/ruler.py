"""Time of an evaluation by part, on two large surfaces: ``python benchmarks/ruler.py``.

CPU seconds of this process (which depend little on other work on the machine) and wall-clock seconds, medians of three,
written to ``experiments/cost/ruler.json``. Target: all metrics but the earth mover's distance within 8 s of wall-clock
time on two idle cores, for 300 000 faces and 100 000 points.
"""

import argparse
import statistics
import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import torch

from meshot.mesh import folded_sphere
from meshot.metrics import Surface, earth_movers_distance, evaluate, mesh_properties, sliced_distance
from meshot.provenance import write_results
from meshot_book.notebook import table

OUTPUT = Path(__file__).resolve().parent.parent / "experiments" / "cost" / "ruler.json"
WHOLE = "all but EMD, floors included"
LIMIT_S = 8.0


def timed(part: str, call: Callable[[], object]) -> dict:
    """CPU seconds and wall-clock seconds of one call."""
    cpu, wall = time.process_time(), time.perf_counter()
    call()
    return {"part": part, "CPU s": time.process_time() - cpu, "wall s": time.perf_counter() - wall}


def measured(subdivisions: int, n_points: int, emd_sizes: list[int]) -> list[dict]:
    """Times of the parts of an evaluation, of all of it without EMD (one point for it), and of EMD at several sizes."""
    predicted, target = folded_sphere(subdivisions, depth=6.2), folded_sphere(subdivisions)
    surface = Surface(target)
    one, other = surface.sample(n_points, 0), surface.sample(n_points, 1)
    rows = [
        timed("search tree", lambda: Surface(predicted)),
        timed("sample", lambda: surface.sample(n_points, 2)),
        timed("points to faces, one side", lambda: surface.offsets(one)),
        timed("SWD", lambda: sliced_distance(one.points, other.points)),
        timed("self-intersection, topology, triangles", lambda: mesh_properties(predicted)),
        timed(WHOLE, lambda: evaluate(predicted, target, n_points, n_emd_points=1)),
    ]
    for n in emd_sizes:
        rows.append(timed(f"EMD, {n} points", lambda n=n: earth_movers_distance(one.points[:n], other.points[:n])))
    return rows


def medians(runs: list[list[dict]]) -> list[dict]:
    """The medians over several runs, as one list of rows."""
    return [
        {key: rows[0][key] if key == "part" else statistics.median(row[key] for row in rows) for key in rows[0]}
        for rows in zip(*runs, strict=True)
    ]


def main(words: list[str] | None = None) -> int:
    """Measure, print and store the times."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--subdivisions", type=int, default=7, help="7 makes 327 680 faces (default: %(default)s)")
    parser.add_argument("--points", type=int, default=100_000)
    parser.add_argument("--emd-points", type=int, nargs="*", default=[2000, 5000, 10_000])
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("-o", "--output", type=Path, default=OUTPUT)
    chosen = parser.parse_args(words)
    torch.set_num_threads(chosen.threads)
    started = time.perf_counter()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        rows = medians([measured(chosen.subdivisions, chosen.points, chosen.emd_points) for _ in range(chosen.repeats)])
    config = {key: value for key, value in vars(chosen).items() if key != "output"}
    config |= {"faces": 20 * 4**chosen.subdivisions}
    print(f"{config['faces']} faces, {chosen.points} points, {chosen.threads} threads\n{table(rows, 3)}")
    (whole,) = [row["wall s"] for row in rows if row["part"] == WHOLE]
    target = {"what": WHOLE, "found_s": whole, "limit_s": LIMIT_S, "met": whole <= LIMIT_S}
    seconds = time.perf_counter() - started
    write_results(
        chosen.output,
        {"parts": rows, "targets": [target]},
        config,
        "python benchmarks/ruler.py",
        "folded spheres",
        seconds,
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
