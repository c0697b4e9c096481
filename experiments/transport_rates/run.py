"""Measure how fast plug-in estimates of W, of sliced Wasserstein and of Chamfer converge to their limits.

Run as ``python experiments/transport_rates/run.py``. Finished repetitions are stored in ``partial.jsonl`` until all are
done, so that a stopped run can be resumed.
"""

import time
from pathlib import Path

import torch
import yaml
from limits import chamfer_limit
from measured import MEASURES, errors
from summary import summarise

from meshot.jobs import run_jobs
from meshot.provenance import write_results

HERE = Path(__file__).parent


def tasks(config: dict) -> list[dict]:
    """All combinations of estimator, pair and size, the slow ones last."""
    found = []
    for estimate in MEASURES:
        settings = config[estimate]
        for pair in settings.get("pairs", config["pairs"]):
            for n_points, n_repetitions in zip(settings["sizes"], settings["repetitions"], strict=True):
                found.append({"estimate": estimate, **pair, "n_points": n_points, "n_repetitions": n_repetitions})
    return sorted(found, key=lambda task: task["n_points"])


def main() -> None:
    """Do the missing tasks, then write the summary."""
    torch.set_num_threads(1)
    started = time.perf_counter()
    config = yaml.safe_load((HERE / "config.yaml").read_text(encoding="utf-8"))
    partial = HERE / "partial.jsonl"
    limits = [chamfer_limit(pair, config) for pair in config["chamfer"]["pairs"]]
    rows = run_jobs(
        tasks(config), lambda task: errors(task, limits, config), partial, folder=HERE, config=config,
        clock=time.process_time,
    )  # fmt: skip
    rows = [row | {"values": row["found"]} for row in rows]
    results = summarise(rows, config) | {"limits": limits}
    seconds = max(sum(row["seconds"] for row in rows), time.perf_counter() - started)
    command = "python experiments/transport_rates/run.py"
    data = "synthetic clouds and surfaces with known distances"
    write_results(HERE / "results.json", results, config, command, data, seconds)
    partial.unlink()


if __name__ == "__main__":
    main()
