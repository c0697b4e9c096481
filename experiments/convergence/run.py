"""Measure the error of the theorem: slopes in the numbers of points and directions, in the dimension, and its bounds.

Run as ``python experiments/convergence/run.py``. Finished runs are stored in ``partial.jsonl`` until all are done, so
that a stopped run can be resumed.
"""

from pathlib import Path

import torch
import yaml
from bounds import bound_runs, bound_summary, bound_values
from directions import direction_errors, direction_runs, direction_summary
from distance import distance_errors, distance_runs, distance_summary
from sizes import size_errors, size_runs, size_summary

from meshot.jobs import run_jobs
from meshot.provenance import write_results

HERE = Path(__file__).parent
#: For each part: its runs, the function of a run, and the summary of the rows.
PARTS = {
    "distance": (distance_runs, distance_errors, distance_summary),
    "bounds": (bound_runs, bound_values, bound_summary),
    "sizes": (size_runs, size_errors, size_summary),
    "directions": (direction_runs, direction_errors, direction_summary),
}


def main() -> None:
    """Do the missing runs, then write the summary."""
    torch.set_num_threads(1)
    config = yaml.safe_load((HERE / "config.yaml").read_text(encoding="utf-8"))
    partial = HERE / "partial.jsonl"
    todo = [run for runs_of, _, _ in PARTS.values() for run in runs_of(config)]
    found = run_jobs(todo, lambda run: PARTS[run["part"]][1](run, config), partial, folder=HERE, config=config)
    rows = [{"run": row["task"], "values": row["found"]} for row in found]
    results = {}
    for part, (_, _, summary) in PARTS.items():
        results |= summary([row for row in rows if row["run"]["part"] == part], config)
    seconds = sum(row["seconds"] for row in found)
    command = "python experiments/convergence/run.py"
    data = "synthetic surfaces and contours, with features"
    write_results(HERE / "results.json", results, config, command, data, seconds)
    partial.unlink()


if __name__ == "__main__":
    main()
