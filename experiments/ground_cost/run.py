"""Compare the Euclidean ground cost with the sum of p-th powers that the paper writes.

Run as ``python experiments/ground_cost/run.py``. Finished combinations of exponent and seed are stored in
``partial.jsonl`` until all are done, so that a stopped run can be resumed.
"""

import sys
from pathlib import Path

import numpy as np
from costs import asked_rows, minimiser_row, sliced_rows, transport_row

from meshot.provenance import rounded

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment


def tasks(config: dict) -> list[tuple[float, int]]:
    """All exponents and seeds."""
    return [(p, seed) for p in config["exponents"] for seed in config["seeds"]]


def row_of(task: tuple[float, int], config: dict) -> dict:
    """All measurements for one exponent and one seed."""
    p, seed = task
    return {"p": p, "seed": seed} | transport_row(seed, p, config) | minimiser_row(seed, p, config)


def summarise(rows: list[dict], config: dict) -> dict:
    """Mean and standard deviation over seeds of all measurements, for every exponent; and what needs no seed."""
    rows, found = [row["found"] for row in rows], []
    for p in dict.fromkeys(row["p"] for row in rows):
        group = [row for row in rows if row["p"] == p]
        names = [name for name in group[0] if name not in ("p", "seed")]
        means = {f"{name}_mean": float(np.mean([row[name] for row in group])) for name in names}
        spread = {f"{name}_sd": float(np.std([row[name] for row in group], ddof=1)) for name in names}
        found.append({"p": p} | means | spread | {"n_seeds": len(group)})
    return rounded({"summary": found, "sliced": sliced_rows(config), "asked": asked_rows(config)})


if __name__ == "__main__":
    experiment.run(__file__, tasks, row_of, summarise, "synthetic surfaces")
