"""Test the axioms of a distance for every loss, and search for the worst violation.

Run as ``python experiments/axioms/run.py``. Finished searches are stored in ``partial.jsonl`` until all are done, so
that a stopped run can be resumed.
"""

import time
from pathlib import Path

import torch
import yaml
from ghosts import measured
from sequences import KINDS, followed
from triangles import search

from meshot.jobs import run_jobs
from meshot.provenance import write_results

HERE = Path(__file__).parent


def main() -> None:
    """Search for violations of the triangle inequality, then measure pairs with equal projections and sequences."""
    torch.set_num_threads(1)
    started = time.perf_counter()
    config = yaml.safe_load((HERE / "config.yaml").read_text(encoding="utf-8"))
    losses, partial = config["losses"], HERE / "partial.jsonl"
    rows = run_jobs(losses, lambda name: search(name, losses[name], config), partial, folder=HERE, config=config)
    ghosts = [
        measured(n, d, config["seed"]) for d in config["ghosts"]["dimensions"] for n in config["ghosts"]["n_directions"]
    ]
    rooted = {name: setting for name, setting in losses.items() if setting["root"]}
    sequences = [followed(kind, name, setting, config) for kind in KINDS for name, setting in rooted.items()]
    results = {"triangles": [row["found"] for row in rows], "ghosts": ghosts, "sequences": sequences}
    seconds = max(sum(row["seconds"] for row in rows), time.perf_counter() - started)
    command, data = "python experiments/axioms/run.py", "drawn and constructed point measures"
    write_results(HERE / "results.json", results, config, command, data, seconds)
    partial.unlink()


if __name__ == "__main__":
    main()
