"""Time of losses in a training step, on a batch of clouds and on one large pair: ``python benchmarks/batches.py``.

Value and gradient in float32, with the same 100 directions for all sliced losses. A batch of 32 pairs of 2048 points in
R³: one call of ours, our loss in a loop, POT in a loop, eight lines of PyTorch that sort the whole batch, and GeomLoss,
which takes a batch, on 4 of the pairs because all of them need 10 GB. Then one pair of 10 000 and of 100 000 points:
ours and POT. CPU seconds of this process and wall-clock seconds, medians, are written to
``experiments/cost/batches.json``. Targets are ratios of CPU seconds, which other work on the machine changes least.
"""

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median

import ot
import torch

import meshot
from meshot.provenance import write_results
from meshot_book.notebook import table

OUTPUT = Path(__file__).resolve().parent.parent / "experiments" / "cost" / "batches.json"
N_DIRECTIONS, N_OF_GEOMLOSS = 100, 4
OURS, LOOP, POT = "one call", "our loss in a loop", "POT in a loop"
SORT, SINKHORN = "PyTorch, the whole batch sorted", f"GeomLoss Sinkhorn, batch of {N_OF_GEOMLOSS}, times {{:g}}"


def batched_sort(x: torch.Tensor, y: torch.Tensor, lines: torch.Tensor) -> torch.Tensor:
    """What one writes without a library, for clouds of equal size and weight."""
    (x, _), (y, _) = (torch.sort(points @ lines.T, dim=1) for points in (x, y))
    return (x - y).square().mean(dim=(1, 2))


def pot(x: torch.Tensor, y: torch.Tensor, lines: torch.Tensor) -> torch.Tensor:
    """The loss of one pair, as POT computes it."""
    return ot.sliced_wasserstein_distance(x, y, projections=lines.T.contiguous()) ** 2


def losses(n_pairs: int, n_points: int, sizes: list[int]) -> dict[str, tuple[Callable, float]]:
    """What is timed, by name: a value and its gradient; and by what its time is multiplied."""
    import geomloss

    draw = torch.Generator().manual_seed(0)
    lines = meshot.quasi_directions(N_DIRECTIONS, 3, dtype=torch.float32)

    def step(loss: Callable, n_pairs: int, n: int) -> Callable:
        x, y = (torch.randn(n_pairs, n, 3, generator=draw) for _ in range(2))
        x.requires_grad_()
        return lambda: torch.autograd.grad(loss(x, y).mean(), x)[0]

    def in_loop(loss: Callable) -> Callable:
        return lambda x, y: torch.stack([loss(a, b, lines) for a, b in zip(x, y, strict=True)])

    ours, sinkhorn = meshot.sliced_wasserstein, geomloss.SamplesLoss("sinkhorn", p=2, blur=0.05)
    part = min(n_pairs, N_OF_GEOMLOSS)
    calls = {
        OURS: (step(lambda x, y: ours(x, y, lines), n_pairs, n_points), 1),
        LOOP: (step(in_loop(ours), n_pairs, n_points), 1),
        POT: (step(in_loop(pot), n_pairs, n_points), 1),
        SORT: (step(lambda x, y: batched_sort(x, y, lines), n_pairs, n_points), 1),
        SINKHORN.format(n_pairs / part): (step(sinkhorn, part, n_points), n_pairs / part),
    }
    for n in sizes:
        calls[f"ours, one pair of {n}"] = step(in_loop(ours), 1, n), 1
        calls[f"POT, one pair of {n}"] = step(in_loop(pot), 1, n), 1
    return calls


def timed(run: Callable[[], object], times: float) -> dict:
    """CPU seconds and wall-clock seconds of one call."""
    cpu, wall = time.process_time(), time.perf_counter()
    run()
    return {"CPU s": times * (time.process_time() - cpu), "wall s": times * (time.perf_counter() - wall)}


def targets(rows: list[dict], sizes: list[int]) -> list[dict]:
    """How many times less CPU time ours takes, and how many times less is asked for."""
    cpu = {row["part"]: row["CPU s"] for row in rows}
    asked = [(f"{POT}, batch", cpu[POT] / cpu[OURS], 20), (f"{SORT}, batch", cpu[SORT] / cpu[OURS], 4)]
    for n, least in zip(sizes, (25, 40), strict=False):
        asked.append((f"POT, one pair of {n}", cpu[f"POT, one pair of {n}"] / cpu[f"ours, one pair of {n}"], least))
    return [{"what": what, "found": found, "at_least": least, "met": found >= least} for what, found, least in asked]


def main(words: list[str] | None = None) -> int:
    """Measure, print and store the times."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=32)
    parser.add_argument("--points", type=int, default=2048)
    parser.add_argument("--sizes", type=int, nargs="*", default=[10_000, 100_000])
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("-o", "--output", type=Path, default=OUTPUT)
    chosen = parser.parse_args(words)
    torch.set_num_threads(chosen.threads)
    started = time.perf_counter()
    rows = []
    for name, (run, times) in losses(chosen.pairs, chosen.points, chosen.sizes).items():
        run()  # compiles, and warms up
        rounds = [timed(run, times) for _ in range(chosen.repeats)]
        rows.append({"part": name} | {key: median(row[key] for row in rounds) for key in rounds[0]})
        print(table(rows[-1:], 3), flush=True)
    results = {"parts": rows, "targets": targets(rows, chosen.sizes)}
    print(f"{table(rows, 3)}\n\n{table(results['targets'], 3)}")
    config = {key: value for key, value in vars(chosen).items() if key != "output"} | {"directions": N_DIRECTIONS}
    seconds = time.perf_counter() - started
    write_results(chosen.output, results, config, "python benchmarks/batches.py", "Gaussian clouds", seconds)
    return 0


if __name__ == "__main__":
    sys.exit(main())
