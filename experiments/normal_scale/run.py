"""The share of the normals in the sliced loss of oriented varifolds, over their scale in mm.

Run as ``python experiments/normal_scale/run.py``. Finished pairs are stored in ``partial.jsonl`` until all are done, so
that a stopped run can be resumed.
"""

import sys
from pathlib import Path

from shares import crossing_scale, measure_pair, pairs

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment


def summarise(rows: list[dict], config: dict) -> dict:
    """What was measured for each pair, and the scale at which the normals are half of the loss."""
    found = ((row["task"], row["found"]) for row in rows)
    return {"pairs": [{"pair": pair, "half_of_loss_at": crossing_scale(of["rows"]), **of} for pair, of in found]}


def work(pair: str, config: dict) -> dict:
    """Everything about one pair of surfaces."""
    return measure_pair(*pairs(config)[pair], config)


if __name__ == "__main__":
    data = "the white and pial surfaces of fsaverage5; synthetic folded surfaces"
    experiment.run(__file__, lambda config: list(pairs(config)), work, summarise, data)
