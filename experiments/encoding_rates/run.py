"""Measure the distance of varifolds and samples from the continuous measure, over the edge length and over time.

Errors are reproducible; the times of the last part are not.
"""

import sys
from pathlib import Path

from clock import measure_clock
from measured import measure_level
from summary import summarise, summarise_clock

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment

MEASURE = {"levels": measure_level, "clock": measure_clock}


def tasks(config: dict) -> list[dict]:
    """All levels of all families in both spaces, the fast ones first; the timing at the end."""
    found = [
        {"part": "levels", "family": family, "level": level, "d": d}
        for family, settings in config["families"].items()
        for level in settings["levels"]
        for d in (3, 6)
    ]
    largest = {"cortex_decimated": 1 / 320, "cortex_split": 2.0}
    found.sort(key=lambda task: task["level"] * largest.get(task["family"], 1.0))
    return found + [{"part": "clock", "pair": name} for name in ("white to pial", "tiny deformation")]


def work(task: dict, config: dict) -> dict:
    """One level, or the times of a pair."""
    return MEASURE[task["part"]](task, config)


def results(rows: list[dict], config: dict) -> dict:
    """The errors of all levels, and the times."""
    return summarise(rows, config) | {"clock": summarise_clock(rows)}


if __name__ == "__main__":
    experiment.run(__file__, tasks, work, results, "synthetic surfaces; FreeSurfer's fsaverage5, left hemisphere")
