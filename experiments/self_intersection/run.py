"""Count self-intersecting faces: given flows, fits by flows and by free vertices, fitted flows with other integrations.

``results`` has four tables, without times, computed on one thread:

- ``given``: vortex (``strength`` is its Lipschitz constant) × ``level`` of the icosphere; ``rows`` by integration.
- ``fits``: ``pair`` × ``loss`` × ``encoding`` × ``spacing`` of the finest grid (0: free vertices) × ``seed``;
  self-intersecting faces at the end and the maximum along the flow, ASSD in mm, local Lipschitz constant along the
  paths, flips.
- ``carried``: arm × ``seed``; ``rows`` by factor and integration, each with ``levels``: self-intersecting faces at the
  end and the maximum along the flow.
- ``differences``: paired over seeds, with 95 % intervals: the effect of the loss, and the effect of the flow.
"""

import itertools
import sys
from pathlib import Path

from carrying import carried_row, given_row
from fitting import fit_row
from summary import differences

from meshot.provenance import rounded

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment

WORK = {"given": given_row, "fits": fit_row, "carried": carried_row}


def tasks(config: dict) -> list[dict]:
    """All tasks, each with the name of its table."""
    given, fits, carried = config["given"], config["fits"], config["carried"]
    todo = [
        {"table": "given", "strength": strength, "level": level}
        for strength, level in itertools.product(given["strengths"], given["levels"])
    ]
    names = ("pair", "loss", "encoding", "spacing", "seed")
    for pair, spacings in fits["spacings"].items():
        arms = itertools.product([pair], fits["losses"], fits["encodings"], spacings, fits["seeds"])
        todo += [{"table": "fits"} | dict(zip(names, arm)) for arm in arms]
    arms = list(itertools.product(carried["arms"], fits["seeds"]))
    for table, spacing in (("carried", carried["spacing"]), ("fits", fits["finest"])):
        todo += [{"table": table} | dict(zip(names, (carried["pair"], *arm, spacing, seed))) for arm, seed in arms]
    return todo


def work(task: dict, config: dict) -> object:
    """The row of a task in its table."""
    return WORK[task["table"]](task, config)


def results(rows: list[dict], config: dict) -> dict:
    """The tables, and the differences between arms."""
    found: dict[str, list] = {name: [] for name in WORK}
    for row in rows:
        more = row["found"] if isinstance(row["found"], dict) else {"rows": row["found"]}
        found[row["task"]["table"]].append({k: v for k, v in row["task"].items() if k != "table"} | more)
    return rounded(found | {"differences": differences(found["fits"])})


if __name__ == "__main__":
    experiment.run(__file__, tasks, work, results, "synthetic folded spheres")
