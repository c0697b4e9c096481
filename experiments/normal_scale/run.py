"""The share of the normals in the sliced loss of oriented varifolds, over their scale in mm.

Run as ``python experiments/normal_scale/run.py``. Finished pairs are stored in ``partial.jsonl`` until all are done, so
that a stopped run can be resumed.
"""

from pathlib import Path

import torch
import yaml
from shares import crossing_scale, measure_pair, pairs

from meshot.jobs import run_jobs
from meshot.provenance import write_results

HERE = Path(__file__).parent


def main() -> None:
    """Do the missing pairs, then write the results."""
    torch.set_num_threads(1)
    config = yaml.safe_load((HERE / "config.yaml").read_text(encoding="utf-8"))
    measured, partial = pairs(config), HERE / "partial.jsonl"
    rows = run_jobs(measured, lambda name: measure_pair(*measured[name], config), partial, folder=HERE, config=config)
    found = [
        {"pair": row["task"], "half_of_loss_at": crossing_scale(row["found"]["rows"]), **row["found"]} for row in rows
    ]
    seconds = sum(row["seconds"] for row in rows)
    command = "python experiments/normal_scale/run.py"
    data = "the white and pial surfaces of fsaverage5; synthetic folded surfaces"
    write_results(HERE / "results.json", {"pairs": found}, config, command, data, seconds)
    partial.unlink()


if __name__ == "__main__":
    main()
