"""Measure which construction of directions errs least, in two, three and six dimensions.

Run as ``python experiments/directions/run.py``. Finished problems are kept in ``partial.jsonl`` until all are done, so
that a run that was stopped goes on where it ended.
"""

import json
import time
from pathlib import Path

import numpy as np
import torch
import yaml
from slices import mean_over_all, methods, relative_errors
from summary import summarise
from tqdm import tqdm

from meshot.provenance import write_results

HERE = Path(__file__).parent


def tasks(config: dict) -> list[dict]:
    """Every problem with every method."""
    return [problem | {"method": name} for problem in config["problems"] for name in methods(problem["d"])]


def measure(task: dict, mean: float, error: float, config: dict) -> dict:
    """The relative errors of one method on one problem, and the mean that they are relative to."""
    errors = relative_errors(task, task["method"], mean, config)
    return {"mean": mean, "mean_error": error, "errors": errors.tolist()}


def main() -> None:
    """Do what is missing, then write the summary."""
    torch.set_num_threads(1)
    started = time.perf_counter()
    config = yaml.safe_load((HERE / "config.yaml").read_text(encoding="utf-8"))
    partial = HERE / "partial.jsonl"
    lines = partial.read_text(encoding="utf-8").splitlines() if partial.exists() else []
    done = {line["key"]: line for line in map(json.loads, lines)}
    for task in tqdm(tasks(config)):
        key = json.dumps(task, sort_keys=True)
        if key in done:
            continue
        before = time.perf_counter()
        if task["method"] == "random":  # the first of every problem
            mean, error = mean_over_all(task, config)
        else:
            mean, error = (
                done[json.dumps(task | {"method": "random"}, sort_keys=True)][k] for k in ("mean", "mean_error")
            )
        done[key] = {"key": key, **measure(task, mean, error, config), "seconds": time.perf_counter() - before}
        with partial.open("a", encoding="utf-8") as file:
            file.write(json.dumps(done[key]) + "\n")
    rows = [task | done[json.dumps(task, sort_keys=True)] for task in tasks(config)]
    means = [
        {name: row[name] for name in ("d", "pair", "p", "mean", "mean_error")}
        for row in rows
        if row["method"] == "random"
    ]
    results = {"means": means} | summarise([row | {"errors": np.array(row["errors"])} for row in rows], config)
    seconds = max(sum(row["seconds"] for row in rows), time.perf_counter() - started)
    data = "continuous synthetic contours and surfaces"
    write_results(HERE / "results.json", results, config, "python experiments/directions/run.py", data, seconds)
    partial.unlink()


if __name__ == "__main__":
    main()
