"""Count self-intersecting faces: given flows, fits by flows and by free vertices, fitted flows with other integrations.

A stopped run can be resumed: every finished task is a line of ``partial.jsonl``. ``results`` has four tables, without
times, computed on one thread:

- ``given``: vortex (``strength`` is its Lipschitz constant) × ``level`` of the icosphere; ``rows`` by integration.
- ``fits``: ``pair`` × ``loss`` × ``encoding`` × ``spacing`` of the finest grid (0: free vertices) × ``seed``;
  self-intersecting faces at the end and the maximum along the flow, ASSD in mm, local Lipschitz constant along the
  paths, flips.
- ``carried``: arm × ``seed``; ``rows`` by factor and integration, each with ``levels``: self-intersecting faces at the
  end and the maximum along the flow.
- ``differences``: paired over seeds, with 95 % intervals: the effect of the loss, and the effect of the flow.
"""

import itertools
import time
from pathlib import Path

import torch
import yaml
from carrying import carried_row, given_row
from fitting import fit_row
from summary import differences

from meshot.jobs import run_jobs
from meshot.provenance import rounded, write_results

HERE = Path(__file__).resolve().parent
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


def main() -> None:
    """Do the missing tasks, then write the tables."""
    torch.set_num_threads(1)
    config = yaml.safe_load((HERE / "config.yaml").read_text(encoding="utf-8"))
    partial = HERE / "partial.jsonl"
    rows = run_jobs(
        tasks(config), lambda task: WORK[task["table"]](task, config), partial, folder=HERE, config=config,
        clock=time.process_time,
    )  # fmt: skip
    results: dict[str, list] = {name: [] for name in WORK}
    for row in rows:
        found = row["found"] if isinstance(row["found"], dict) else {"rows": row["found"]}
        results[row["task"]["table"]].append({k: v for k, v in row["task"].items() if k != "table"} | found)
    results["differences"] = differences(results["fits"])
    seconds = sum(row["seconds"] for row in rows)
    command = "python experiments/self_intersection/run.py"
    write_results(HERE / "results.json", rounded(results), config, command, "synthetic folded spheres", seconds)
    partial.unlink()


if __name__ == "__main__":
    main()
