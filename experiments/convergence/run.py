"""Measure the theorem: slopes in the number of points, of directions, in the dimension; and its fine print.

Run as ``python experiments/convergence/run.py``. Finished runs are kept in ``partial.jsonl`` until all are done,
so that a run that was stopped goes on where it ended.
"""

import json
import time
from pathlib import Path

import torch
import yaml
from bounds import bound_runs, bound_summary, bound_values
from directions import direction_errors, direction_runs, direction_summary
from distance import distance_errors, distance_runs, distance_summary
from sizes import size_errors, size_runs, size_summary
from tqdm import tqdm

from meshot.provenance import write_results

HERE = Path(__file__).parent
#: Part → its runs, what a run finds, and what the part's rows are told as.
PARTS = {
    "distance": (distance_runs, distance_errors, distance_summary),
    "bounds": (bound_runs, bound_values, bound_summary),
    "sizes": (size_runs, size_errors, size_summary),
    "directions": (direction_runs, direction_errors, direction_summary),
}


def main() -> None:
    """Do the runs that are missing, then write the summary."""
    torch.set_num_threads(1)
    config = yaml.safe_load((HERE / "config.yaml").read_text(encoding="utf-8"))
    partial = HERE / "partial.jsonl"
    lines = partial.read_text(encoding="utf-8").splitlines() if partial.exists() else []
    done = {line["key"]: line for line in map(json.loads, lines)}
    todo = [run for part in PARTS for run in PARTS[part][0](config)]
    for run in tqdm(todo):
        key = json.dumps(run, sort_keys=True)
        if key in done:
            continue
        before = time.perf_counter()
        values = PARTS[run["part"]][1](run, config)
        done[key] = {"key": key, "run": run, "values": values, "seconds": time.perf_counter() - before}
        with partial.open("a", encoding="utf-8") as file:
            file.write(json.dumps(done[key]) + "\n")
    rows = [done[json.dumps(run, sort_keys=True)] for run in todo]
    results = {}
    for part, (_, _, summary) in PARTS.items():
        results |= summary([row for row in rows if row["run"]["part"] == part], config)
    seconds = sum(row["seconds"] for row in rows)
    command = "python experiments/convergence/run.py"
    data = "synthetic surfaces and contours, with features"
    write_results(HERE / "results.json", results, config, command, data, seconds)
    partial.unlink()


if __name__ == "__main__":
    main()
