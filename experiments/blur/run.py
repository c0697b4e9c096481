"""Compare Sinkhorn divergences of several blurs with sliced Wasserstein, and measure the limits of the divergence."""

import json
import sys
from pathlib import Path

import numpy as np
import torch
from fitting import judged, make_pair, run_once
from limits import limit_rows

from meshot.mesh import face_areas
from meshot.provenance import rounded
from meshot_book.statistics import arm_differences

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment

MEASURED = ("w2_varifold", "sw2_surface", "assd", "emd")


def summarise(rows: list[dict]) -> dict[str, list[dict]]:
    """Means and deviations over seeds for each loss, and its paired difference from sliced Wasserstein (95 %)."""
    groups: dict[str, list[dict]] = {}
    for row in rows:
        groups.setdefault(json.dumps(row["run"]), []).append(row)
    fits = []
    for group in groups.values():
        values = {f"{name}_seeds": [row["values"][name] for row in group] for name in MEASURED}
        means = {f"{name}_mean": float(np.mean(values[f"{name}_seeds"])) for name in MEASURED}
        spread = {f"{name}_sd": float(np.std(values[f"{name}_seeds"], ddof=1)) for name in MEASURED}
        fits.append(group[0]["run"] | means | spread | values | {"n_seeds": len(group)})
    sliced = next(row for row in fits if row["loss"] == "sliced")
    return {"fits": fits, "differences": [_difference(row, sliced) for row in fits if row is not sliced]}


def _difference(row: dict, sliced: dict) -> dict:
    found = {key: value for key, value in row.items() if key in ("loss", "blur_mm", "scaling")}
    arms = ({name: arm[f"{name}_seeds"] for name in MEASURED} for arm in (row, sliced))
    return found | arm_differences(*arms, centre="mean")


def yardsticks(config: dict) -> dict:
    """Reference values in mm: the metrics of the start and of a perfect fit, and lengths to compare a blur with."""
    pairs = [make_pair(seed, config) for seed in config["seeds"]]
    starts = [judged(start, target, config) for start, target in pairs]
    perfect = [judged(target, target, config) for _, target in pairs[:1]]
    target = pairs[0][1]
    widest = float(torch.cdist(target.vertices, target.vertices).max())
    spacing = float(face_areas(target).sum() / len(target.faces)) ** 0.5
    return {
        "start": {name: float(np.mean([row[name] for row in starts])) for name in MEASURED},
        "floor": perfect[0],
        "lengths_mm": {"diameter": widest, "spacing": spacing, "n_supports": len(target.faces)},
    }


def tasks(config: dict) -> list[tuple[dict, int]]:
    """All losses and seeds."""
    return [(run, seed) for seed in config["seeds"] for run in config["losses"]]


def work(task: tuple[dict, int], config: dict) -> dict:
    """One fit."""
    return run_once(*task, config)


def results(rows: list[dict], config: dict) -> dict:
    """The fits, the limits of the divergence, and what they are compared with."""
    fits = [{"run": row["task"][0], "seed": row["task"][1], "values": row["found"]} for row in rows]
    return rounded(summarise(fits) | {"limits": limit_rows(config)} | yardsticks(config))


if __name__ == "__main__":
    experiment.run(__file__, tasks, work, results, "synthetic folded spheres")
