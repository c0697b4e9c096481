"""Fits with a fixed number of support points: time and memory as the mesh grows, and the results of fits.

``results.json`` has, under "results":

- ``costs``: ``loss`` ("sliced", "chamfer"), ``variant`` ("all": the whole varifold; "drawn": a fixed number of faces
  drawn from the mesh after the flow, with gradients that stop at their areas; "through": with gradients that do not;
  "carried": drawn before the flow, which moves only their corners), ``n_faces``, ``step_bytes`` and ``step_seconds``
  of a step of a fit (flow, loss, gradient), ``loss_bytes`` and ``loss_seconds`` of the loss and its gradient alone.
  Bytes are the maximum held by autograd at a time, seconds are CPU seconds of one thread;
- ``fits``: from a sphere to an analytic surface under the sliced loss: ``variant``, ``n_supports``, ``n_seeds``, and
  mean, sd and values per seed of ``assd`` (mm), ``edge_variation`` and ``intersecting_faces``;
- ``differences``: paired over seeds, a fixed number minus all: ``assd_gap``, ``assd_low``, ``assd_high`` (95 %).
"""

import sys
from pathlib import Path

import numpy as np
from costs import cost_rows
from variants import fit_loss, pair_of_meshes

from meshot import evaluate
from meshot.flow import FitSettings, fit_flow, grid_around
from meshot.provenance import rounded
from meshot_book.statistics import arm_differences

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment

MEASURED = ("assd", "edge_variation", "intersecting_faces")


def planned_fits(config: dict) -> list[dict]:
    """All support points, and every fixed number, for every seed."""
    fits = config["fits"]
    n_faces = 20 * 4 ** fits["subdivisions"]
    kinds = [("all", n_faces)] + [(variant, n) for variant, counts in fits["n_supports"].items() for n in counts]
    return [{"variant": v, "n_supports": n, "seed": seed} for v, n in kinds for seed in fits["seeds"]]


def fit_once(task: dict, config: dict) -> dict[str, float]:
    """One fit, with closeness and regularity of its mesh."""
    fits = config["fits"]
    start, target = pair_of_meshes(fits["subdivisions"], task["seed"], config)
    spacings = tuple(config["grid"]["spacings"])
    field = grid_around(start.vertices, target.vertices, **config["grid"] | {"spacings": spacings})
    settings = FitSettings(
        n_iterations=fits["n_iterations"], learning_rate=fits["learning_rate"], n_steps=config["n_steps"],
        n_directions=tuple(fits["n_directions"]), seed=task["seed"],
    )  # fmt: skip
    loss = fit_loss(task["variant"], task["n_supports"], start, target, config["normal_scale"])
    values = evaluate(fit_flow(field, start, loss, settings).mesh, target, config["n_points"], n_emd_points=100)
    return {name: short(getattr(values, name).value) for name in MEASURED}


def short(value: float) -> float:
    """The value with six significant digits, so that committed files stay small."""
    return float(f"{value:.6g}")


def summarise(rows: list[dict]) -> list[dict]:
    """Statistics of every variant and number of support points over the seeds."""
    groups: dict[tuple, list[dict]] = {}
    for row in rows:
        groups.setdefault((row["task"]["variant"], row["task"]["n_supports"]), []).append(row["found"])
    summary = []
    for (variant, n_supports), group in groups.items():
        row = {"variant": variant, "n_supports": n_supports, "n_seeds": len(group)}
        for name in MEASURED:
            values = np.array([found[name] for found in group])
            row |= {f"{name}_mean": short(values.mean()), f"{name}_sd": short(values.std(ddof=1))}
            row[f"{name}_seeds"] = values.tolist()
        summary.append(row)
    return summary


def differences(summary: list[dict]) -> list[dict]:
    """A fixed number minus all, paired over seeds, with the 95 % interval (Student's t)."""
    whole = next(row for row in summary if row["variant"] == "all")
    rows = []
    for row in (row for row in summary if row["variant"] != "all"):
        kind = {"variant": row["variant"], "n_supports": row["n_supports"], "n_seeds": row["n_seeds"]}
        rows.append(kind | rounded(arm_differences({"assd": row["assd_seeds"]}, {"assd": whole["assd_seeds"]})))
    return rows


def results(rows: list[dict], config: dict) -> dict:
    """The costs of a step, the fits, and their differences."""
    summary = summarise(rows)
    return {"costs": cost_rows(config), "fits": summary, "differences": differences(summary)}


if __name__ == "__main__":
    experiment.run(__file__, planned_fits, fit_once, results, "analytic folded surfaces")
