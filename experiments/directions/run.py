"""Measure which construction of directions has the smallest error, in two, three and six dimensions.

Run as ``python experiments/directions/run.py``. Finished problems are stored in ``partial.jsonl`` until all are done,
so that a stopped run can be resumed.
"""

import time
from pathlib import Path

import numpy as np
import torch
import yaml
from slices import mean_over_all, methods, relative_errors
from summary import summarise

from meshot.jobs import run_jobs
from meshot.provenance import write_results

HERE = Path(__file__).parent


def tasks(config: dict) -> list[dict]:
    """All combinations of problem and method."""
    return [problem | {"method": name} for problem in config["problems"] for name in methods(problem["d"])]


def mean_of(problem: dict, config: dict) -> dict:
    """The mean over all directions and its standard error."""
    return dict(zip(("mean", "mean_error"), mean_over_all(problem, config), strict=True))


def problem_of(row: dict) -> tuple:
    """The problem that a task or a mean belongs to."""
    return row["d"], row["pair"], row["p"]


def main() -> None:
    """Do the missing tasks, then write the summary."""
    torch.set_num_threads(1)
    started = time.perf_counter()
    config = yaml.safe_load((HERE / "config.yaml").read_text(encoding="utf-8"))
    partial = HERE / "partial.jsonl"
    first = run_jobs(config["problems"], lambda task: mean_of(task, config), partial, folder=HERE, config=config)
    means = [row["task"] | row["found"] for row in first]
    mean = {problem_of(row): row["mean"] for row in means}
    rows = run_jobs(
        tasks(config), lambda task: relative_errors(task, task["method"], mean[problem_of(task)], config).tolist(),
        partial, folder=HERE, config=config,
    )  # fmt: skip
    results = {"means": means}
    results |= summarise([row["task"] | {"errors": np.array(row["found"])} for row in rows], config)
    seconds = max(sum(row["seconds"] for row in first + rows), time.perf_counter() - started)
    data = "continuous synthetic contours and surfaces"
    write_results(HERE / "results.json", results, config, "python experiments/directions/run.py", data, seconds)
    partial.unlink()


if __name__ == "__main__":
    main()
