"""Measure the distance of varifolds and samples from the continuous measure, over the edge length and over time.

Run as ``python experiments/encoding_rates/run.py``. Finished levels are stored in ``partial.jsonl`` until all are done,
so that a stopped run can be resumed. Errors are reproducible; the times of the last part are not.
"""

import time
from pathlib import Path

import torch
import yaml
from clock import measure_clock
from measured import measure_level
from summary import summarise, summarise_clock

from meshot.jobs import run_jobs
from meshot.provenance import write_results

HERE = Path(__file__).parent
MEASURE = {"levels": measure_level, "clock": measure_clock}


def tasks(config: dict) -> list[dict]:
    """All levels of all families in both spaces, the fast ones first; the timing at the end."""
    found = [
        {"part": "levels", "family": family, "level": level, "d": d}
        for family, settings in config["families"].items()
        for level in settings["levels"]
        for d in (3, 6)
    ]
    largest = {"cortex_decimated": 1 / 320, "cortex_split": 2.0}
    found.sort(key=lambda task: task["level"] * largest.get(task["family"], 1.0))
    return found + [{"part": "clock", "pair": name} for name in ("white to pial", "tiny deformation")]


def main() -> None:
    """Do the missing tasks, then write the summary."""
    torch.set_num_threads(1)
    started = time.perf_counter()
    config = yaml.safe_load((HERE / "config.yaml").read_text(encoding="utf-8"))
    partial = HERE / "partial.jsonl"
    rows = run_jobs(
        tasks(config), lambda task: MEASURE[task["part"]](task, config), partial, folder=HERE, config=config,
        clock=time.process_time,
    )  # fmt: skip
    results = summarise(rows, config) | {"clock": summarise_clock(rows)}
    seconds = max(sum(row["seconds"] for row in rows), time.perf_counter() - started)
    command = "python experiments/encoding_rates/run.py"
    data = "synthetic surfaces; FreeSurfer's fsaverage5, left hemisphere"
    write_results(HERE / "results.json", results, config, command, data, seconds)
    partial.unlink()


if __name__ == "__main__":
    main()
