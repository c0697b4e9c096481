"""Compare the Euclidean ground cost with the sum of p-th powers that the paper writes.

Run as ``python experiments/ground_cost/run.py``. Finished combinations of exponent and seed are stored in
``partial.jsonl`` until all are done, so that a stopped run can be resumed.
"""

import time
from pathlib import Path

import numpy as np
import torch
import yaml
from costs import asked_rows, minimiser_row, sliced_rows, transport_row

from meshot.jobs import run_jobs
from meshot.provenance import rounded, write_results

HERE = Path(__file__).resolve().parent


def main() -> None:
    """All exponents and seeds, then the summary. Takes one minute."""
    torch.set_num_threads(1)
    started = time.perf_counter()
    config = yaml.safe_load((HERE / "config.yaml").read_text(encoding="utf-8"))
    todo = [(p, seed) for p in config["exponents"] for seed in config["seeds"]]
    partial = HERE / "partial.jsonl"
    found = run_jobs(todo, lambda task: row_of(*task, config), partial, folder=HERE, config=config)
    rows = [row["found"] for row in found]
    results = {"summary": summarise(rows), "sliced": sliced_rows(config), "asked": asked_rows(config)}
    command = "python experiments/ground_cost/run.py"
    seconds = max(sum(row["seconds"] for row in found), time.perf_counter() - started)
    write_results(HERE / "results.json", rounded(results), config, command, "synthetic surfaces", seconds)
    partial.unlink()


def row_of(p: float, seed: int, config: dict) -> dict:
    """All measurements for one exponent and one seed."""
    return {"p": p, "seed": seed} | transport_row(seed, p, config) | minimiser_row(seed, p, config)


def summarise(rows: list[dict]) -> list[dict]:
    """Mean and standard deviation over seeds of all measurements, for every exponent."""
    found = []
    for p in dict.fromkeys(row["p"] for row in rows):
        group = [row for row in rows if row["p"] == p]
        names = [name for name in group[0] if name not in ("p", "seed")]
        means = {f"{name}_mean": float(np.mean([row[name] for row in group])) for name in names}
        spread = {f"{name}_sd": float(np.std([row[name] for row in group], ddof=1)) for name in names}
        found.append({"p": p} | means | spread | {"n_seeds": len(group)})
    return found


if __name__ == "__main__":
    main()
