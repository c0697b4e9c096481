"""Test the axioms of a distance for every loss, and search for the worst violation.

Run as ``python experiments/axioms/run.py``. Finished searches are stored in ``partial.jsonl`` until all are done, so
that a stopped run can be resumed.
"""

import sys
from pathlib import Path

from ghosts import measured
from sequences import KINDS, followed
from triangles import search

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment


def tasks(config: dict) -> list[str]:
    """A search for each loss."""
    return list(config["losses"])


def work(name: str, config: dict) -> dict:
    """The worst violations of the triangle inequality that a search finds."""
    return search(name, config["losses"][name], config)


def summarise(rows: list[dict], config: dict) -> dict:
    """The violations, pairs with equal projections, and sequences."""
    kinds = config["ghosts"]
    ghosts = [measured(n, d, config["seed"]) for d in kinds["dimensions"] for n in kinds["n_directions"]]
    rooted = {name: setting for name, setting in config["losses"].items() if setting["root"]}
    sequences = [followed(kind, name, setting, config) for kind in KINDS for name, setting in rooted.items()]
    return {"triangles": [row["found"] for row in rows], "ghosts": ghosts, "sequences": sequences}


if __name__ == "__main__":
    experiment.run(__file__, tasks, work, summarise, "drawn and constructed point measures")
