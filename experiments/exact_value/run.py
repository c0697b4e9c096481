"""The exact sliced loss of continuous surfaces: its accuracy, its time, the error of samples, and a descent with it.

Run as ``python experiments/exact_value/run.py``. Finished parts are stored in ``partial.jsonl`` until all are done, so
that a stopped run can be resumed.
"""

from pathlib import Path

import torch
import yaml
from accuracy import accuracy
from fitting import descents
from sampling import sampling, times

from meshot.jobs import run_jobs
from meshot.provenance import write_results

HERE = Path(__file__).parent
PARTS = {"accuracy": accuracy, "sampling": sampling, "time": times, "descent": descents}


def main() -> None:
    """Do the missing parts, then write the results."""
    torch.set_num_threads(1)
    config = yaml.safe_load((HERE / "config.yaml").read_text(encoding="utf-8"))
    partial = HERE / "partial.jsonl"
    rows = run_jobs(PARTS, lambda name: PARTS[name](config), partial, folder=HERE, config=config)
    results = {row["task"]: row["found"] for row in rows}
    seconds = sum(row["seconds"] for row in rows)
    command = "python experiments/exact_value/run.py"
    data = "synthetic shapes; the white and pial surfaces of fsaverage5"
    write_results(HERE / "results.json", results, config, command, data, seconds)
    partial.unlink()


if __name__ == "__main__":
    main()
