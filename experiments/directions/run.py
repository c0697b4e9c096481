"""Measure which construction of directions has the smallest error, in two, three and six dimensions.

Run as ``python experiments/directions/run.py``. Finished problems are stored in ``partial.jsonl`` until all are done,
so that a stopped run can be resumed.
"""

import functools
import sys
from pathlib import Path

import numpy as np
from slices import mean_over_all, methods, relative_errors
from summary import summarise

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment


def tasks(config: dict) -> list[dict]:
    """All problems, for their means; then all combinations of problem and method."""
    problems = config["problems"]
    return problems + [problem | {"method": name} for problem in problems for name in methods(problem["d"])]


def work(task: dict, config: dict) -> dict | list:
    """The mean over all directions and its standard error; or the errors of a method relative to this mean."""
    mean, error = mean_over((task["d"], task["pair"], task["p"]), config)
    if "method" not in task:
        return {"mean": mean, "mean_error": error}
    return relative_errors(task, task["method"], mean, config).tolist()


@functools.cache
def mean_over(problem: tuple, config: dict) -> tuple[float, float]:
    """The mean over all directions and its standard error."""
    return mean_over_all(dict(zip(("d", "pair", "p"), problem, strict=True)), config)


def results(rows: list[dict], config: dict) -> dict:
    """The means, and the errors of the methods."""
    means = [row["task"] | row["found"] for row in rows if "method" not in row["task"]]
    errors = [row["task"] | {"errors": np.array(row["found"])} for row in rows if "method" in row["task"]]
    return {"means": means} | summarise(errors, config)


if __name__ == "__main__":
    experiment.run(__file__, tasks, work, results, "continuous synthetic contours and surfaces")
