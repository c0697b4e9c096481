"""The exact sliced loss of continuous surfaces: its accuracy, its time, the error of samples, and a descent with it.

Run as ``python experiments/exact_value/run.py``. Finished parts are stored in ``partial.jsonl`` until all are done, so
that a stopped run can be resumed.
"""

import sys
from pathlib import Path

from accuracy import accuracy
from fitting import descents
from sampling import sampling, times

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment

PARTS = {"accuracy": accuracy, "sampling": sampling, "time": times, "descent": descents}


def work(part: str, config: dict) -> object:
    """The results of a part."""
    return PARTS[part](config)


def summarise(rows: list[dict], config: dict) -> dict:
    """The results of all parts."""
    return {row["task"]: row["found"] for row in rows}


if __name__ == "__main__":
    data = "synthetic shapes; the white and pial surfaces of fsaverage5"
    experiment.run(__file__, lambda config: list(PARTS), work, summarise, data)
