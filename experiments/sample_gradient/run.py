"""Gradients through samples: the bias for fixed draws, and its effect on a descent.

Run as ``python experiments/sample_gradient/run.py``. Finished parts are stored in ``partial.jsonl`` until all are done,
so that a stopped run can be resumed.
"""

import sys
from pathlib import Path

from bias import curve, losses
from fitting import descents

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment

PARTS = {"curve": curve, "losses": losses, "descent": descents}


def work(part: str, config: dict) -> object:
    """The results of a part."""
    return PARTS[part](config)


def summarise(rows: list[dict], config: dict) -> dict:
    """The results of all parts."""
    return {row["task"]: row["found"] for row in rows}


if __name__ == "__main__":
    experiment.run(__file__, lambda config: list(PARTS), work, summarise, "synthetic contours and surfaces")
