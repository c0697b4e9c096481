"""Weights and areas: 1D transport against other libraries, descents with and without gradients through the areas.

Run as ``python experiments/weights_and_areas/run.py``, on one thread. Finished descents are stored in ``partial.jsonl``
until all are done, so that a stopped run can be resumed.
"""

import time
from pathlib import Path

import torch
import yaml
from checks import forgotten_areas, merging_errors
from descents import run_once
from summary import gradient_rows, summarise

from meshot.jobs import run_jobs
from meshot.provenance import write_results

HERE = Path(__file__).parent


def planned_runs(config: dict) -> list[dict]:
    """The settings of all descents, except the seed."""
    return [
        {"target": target, "encoding": encoding, "detach_weights": detach, "learning_rate": rate}
        for target in config["targets"]
        for encoding in config["encodings"]
        for detach in (False, True)
        for rate in config["learning_rates"]
    ]


def main() -> None:
    """Do the missing descents, then the fast parts, and write the results."""
    torch.set_num_threads(1)
    started = time.perf_counter()
    config = yaml.safe_load((HERE / "config.yaml").read_text(encoding="utf-8"))
    partial = HERE / "partial.jsonl"
    todo = [(run, seed) for run in planned_runs(config) for seed in config["seeds"]]
    found = run_jobs(todo, lambda task: run_once(*task, config), partial, folder=HERE, config=config)
    rows = [{"run": run, "seed": seed, "values": row["found"]} for (run, seed), row in zip(todo, found, strict=True)]
    results = summarise(rows) | {"gradients": gradient_rows(config)}
    results |= {"merging": merging_errors(config["merging"]), "areas": forgotten_areas(config)}
    seconds = max(sum(row["seconds"] for row in found), time.perf_counter() - started)
    command = "python experiments/weights_and_areas/run.py"
    write_results(HERE / "results.json", results, config, command, "synthetic surfaces", seconds)
    partial.unlink()


if __name__ == "__main__":
    main()
