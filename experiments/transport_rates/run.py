"""Measure how fast plug-in estimates of W, of sliced Wasserstein and of Chamfer converge to their limits."""

import functools
import sys
from pathlib import Path

from limits import chamfer_limit
from measured import MEASURES, errors
from summary import summarise

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment


def tasks(config: dict) -> list[dict]:
    """All combinations of estimator, pair and size, the slow ones last."""
    found = []
    for estimate in MEASURES:
        settings = config[estimate]
        for pair in settings.get("pairs", config["pairs"]):
            for n_points, n_repetitions in zip(settings["sizes"], settings["repetitions"], strict=True):
                found.append({"estimate": estimate, **pair, "n_points": n_points, "n_repetitions": n_repetitions})
    return sorted(found, key=lambda task: task["n_points"])


@functools.cache
def limits(config: dict) -> list[dict]:
    """The limits of Chamfer without a closed form, and those with one."""
    return [chamfer_limit(pair, config) for pair in config["chamfer"]["pairs"]]


def work(task: dict, config: dict) -> list:
    """The errors of the repetitions of a task."""
    return errors(task, limits(config), config)


def results(rows: list[dict], config: dict) -> dict:
    """The errors over the size, and the limits."""
    return summarise([row | {"values": row["found"]} for row in rows], config) | {"limits": limits(config)}


if __name__ == "__main__":
    experiment.run(__file__, tasks, work, results, "synthetic clouds and surfaces with known distances")
