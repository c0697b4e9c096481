"""Run the toy experiment for polygons, samplings, reductions, directions, regularisers and numbers of points."""

import sys
from pathlib import Path

from summary import floors, summarise
from toy import run_once

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment


def sweep_runs(config: dict) -> list[dict]:
    """The settings of all runs, except the seed."""
    base = {"n_points": config["n_points"], "sampling": "even"}
    main = [
        {"part": "summary", **base, "polygon": polygon, "sampling": sampling, **variant}
        for polygon in config["polygons"]
        for sampling in config["samplings"]
        for variant in config["variants"]
    ]
    plain = config["variants"][0]
    held = [
        {"part": "regularisers", **base, "polygon": polygon, **plain, "regulariser": name, "weight": weight}
        for polygon in config["regularisers"]["polygons"]
        for name, weights in config["regularisers"]["weights"].items()
        for weight in weights
    ]
    star = next(iter(config["polygons"]))
    sliced_mean, sliced_sum = config["variants"][3], config["variants"][5]
    sizes = [
        {"part": "sizes", **base, "polygon": star, "n_points": n_points, **variant}
        for n_points in config["sizes"]
        for variant in (plain, sliced_mean, sliced_sum)
    ]
    return main + held + sizes


def tasks(config: dict) -> list[tuple[dict, int]]:
    """All settings and seeds."""
    return [(run, seed) for run in sweep_runs(config) for seed in config["seeds"]]


def work(task: tuple[dict, int], config: dict) -> dict:
    """One run."""
    return run_once(*task, config)


def results(rows: list[dict], config: dict) -> dict:
    """The runs, and the floors of the metrics."""
    runs = [{"run": row["task"][0], "seed": row["task"][1], "values": row["found"]} for row in rows]
    return summarise(runs) | {"floors": floors(config)}


if __name__ == "__main__":
    experiment.run(__file__, tasks, work, results, "synthetic polygons")
