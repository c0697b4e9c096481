"""Weights and areas: 1D transport against other libraries, descents with and without gradients through the areas."""

import sys
from pathlib import Path

from checks import forgotten_areas, merging_errors
from descents import run_once
from summary import gradient_rows, summarise

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment


def planned_runs(config: dict) -> list[dict]:
    """The settings of all descents, except the seed."""
    return [
        {"target": target, "encoding": encoding, "detach_weights": detach, "learning_rate": rate}
        for target in config["targets"]
        for encoding in config["encodings"]
        for detach in (False, True)
        for rate in config["learning_rates"]
    ]


def tasks(config: dict) -> list[tuple[dict, int]]:
    """All settings and seeds."""
    return [(run, seed) for run in planned_runs(config) for seed in config["seeds"]]


def work(task: tuple[dict, int], config: dict) -> dict:
    """One descent."""
    return run_once(*task, config)


def results(rows: list[dict], config: dict) -> dict:
    """The descents, and the fast parts."""
    runs = [{"run": row["task"][0], "seed": row["task"][1], "values": row["found"]} for row in rows]
    found = summarise(runs) | {"gradients": gradient_rows(config)}
    return found | {"merging": merging_errors(config["merging"]), "areas": forgotten_areas(config)}


if __name__ == "__main__":
    experiment.run(__file__, tasks, work, results, "synthetic surfaces")
