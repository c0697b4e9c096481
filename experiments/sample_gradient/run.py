"""Gradients through samples: the bias for fixed draws, and its effect on a descent.

Run as ``python experiments/sample_gradient/run.py``. Finished parts are stored in ``partial.jsonl`` until all are done,
so that a stopped run can be resumed.
"""

from pathlib import Path

import torch
import yaml
from bias import curve, losses
from fitting import descents

from meshot.jobs import run_jobs
from meshot.provenance import write_results

HERE = Path(__file__).parent
PARTS = {"curve": curve, "losses": losses, "descent": descents}


def main() -> None:
    """Do the missing parts, then write the results."""
    torch.set_num_threads(1)
    config = yaml.safe_load((HERE / "config.yaml").read_text(encoding="utf-8"))
    partial = HERE / "partial.jsonl"
    rows = run_jobs(PARTS, lambda name: PARTS[name](config), partial, folder=HERE, config=config)
    results = {row["task"]: row["found"] for row in rows}
    seconds = sum(row["seconds"] for row in rows)
    command = "python experiments/sample_gradient/run.py"
    write_results(HERE / "results.json", results, config, command, "synthetic contours and surfaces", seconds)
    partial.unlink()


if __name__ == "__main__":
    main()
