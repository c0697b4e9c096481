"""Measure the error of the theorem: slopes in numbers of points and directions and in the dimension, and its bounds."""

import sys
from pathlib import Path

from bounds import bound_runs, bound_summary, bound_values
from directions import direction_errors, direction_runs, direction_summary
from distance import distance_errors, distance_runs, distance_summary
from sizes import size_errors, size_runs, size_summary

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment

#: For each part: its runs, the function of a run, and the summary of the rows.
PARTS = {
    "distance": (distance_runs, distance_errors, distance_summary),
    "bounds": (bound_runs, bound_values, bound_summary),
    "sizes": (size_runs, size_errors, size_summary),
    "directions": (direction_runs, direction_errors, direction_summary),
}


def tasks(config: dict) -> list[dict]:
    """The runs of all parts."""
    return [run for runs_of, _, _ in PARTS.values() for run in runs_of(config)]


def work(run: dict, config: dict) -> object:
    """One run."""
    return PARTS[run["part"]][1](run, config)


def results(rows: list[dict], config: dict) -> dict:
    """The summaries of all parts."""
    found, runs = {}, [{"run": row["task"], "values": row["found"]} for row in rows]
    for part, (_, _, summary) in PARTS.items():
        found |= summary([row for row in runs if row["run"]["part"] == part], config)
    return found


if __name__ == "__main__":
    experiment.run(__file__, tasks, work, results, "synthetic surfaces and contours, with features")
