"""Run the toy experiment for several polygons, samplings, reductions, directions, regularisers and numbers of points.

Run as ``python experiments/circle_to_polygon/run.py``. Finished runs are stored in ``partial.jsonl`` until all are
done, so that a stopped run can be resumed.
"""

import time
from pathlib import Path

import torch
import yaml
from summary import floors, summarise
from toy import run_once

from meshot.jobs import run_jobs
from meshot.provenance import write_results

HERE = Path(__file__).parent


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


def main() -> None:
    """Do the missing runs, then write the summary."""
    torch.set_num_threads(1)
    started = time.perf_counter()
    config = yaml.safe_load((HERE / "config.yaml").read_text(encoding="utf-8"))
    partial = HERE / "partial.jsonl"
    todo = [(run, seed) for run in sweep_runs(config) for seed in config["seeds"]]
    found = run_jobs(todo, lambda task: run_once(*task, config), partial, folder=HERE, config=config)
    rows = [{"run": run, "seed": seed, "values": row["found"]} for (run, seed), row in zip(todo, found, strict=True)]
    results = summarise(rows) | {"floors": floors(config)}
    seconds = max(sum(row["seconds"] for row in found), time.perf_counter() - started)
    command = "python experiments/circle_to_polygon/run.py"
    write_results(HERE / "results.json", results, config, command, "synthetic polygons", seconds)
    partial.unlink()


if __name__ == "__main__":
    main()
