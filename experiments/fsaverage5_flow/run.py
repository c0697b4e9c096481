"""Fit flows from smooth surfaces to fsaverage5's white surface, both hemispheres, without self-intersections.

Every fit saves its state, so that a stopped run can be resumed with the same result.

Three *tasks* for each hemisphere, see ``config.yaml``: ``sliced``, from the slightly smoothed target, by sliced
Wasserstein on varifolds alone; ``mixture``, which continues with Chamfer on a finer grid; ``far``, from a surface
without the folds and with another connectivity. Each gives a sequence of flows (:mod:`meshot_book.flows`).

``results.json`` has, under "results" → hemisphere → task (lengths in mm):

- ``goal``, ``stretch`` (null if there is none), ``assd``, ``intersecting_faces``, and computed from them ``reached``,
  ``stretched``;
- ``seconds`` (wall-clock) and ``cpu_seconds`` of all fits of the sequence, including checks; ``n_vertices``,
  ``n_faces``;
- ``fits``, one per leg (see ``fit_record``): ``loss`` (means over ten iterations), at every check
  ``checked_iteration``, ``checked_loss``, ``checked_crossings``, ``assd``, ``cpu_seconds``; ``backtrack_iteration``,
  ``best_iteration``, ``n_steps``; ``mending`` {``crossings`` of the leg as ``fitted``, with the start ``cut`` where the
  sequence stretches it, with the flow ``damped`` where faces intersected; ``n_faces`` after division; ``seconds``};
  ``seconds`` and ``cpu_seconds_in_all``, including repair;
- ``before``, ``after``: ``metrics`` {name: value, unit, definition, floor}, ``smallest_angles`` {percentile: degrees};
- ``path`` (see ``watched_path``): ``crossings`` before the first step and after every step of the sequence;
  ``legs``: local Lipschitz constants, h·Lip, flips, volume factors; ``largest_move``;
- ``stored`` (if the flow is stored): ``files``, and ``assd`` and ``intersecting_faces`` of the rounded flow in them.

The stored flows are read by ``stored.stored_flow(hemisphere, task)``: the start, and the legs of the sequence, for
:func:`meshot_book.flows.chain_trajectory`.
"""

import sys
from pathlib import Path

import numpy as np
import torch
from fitting import closeness, fit_leg, mended_chain
from stored import read_flow, write_flow
from surfaces import carried, start_surface, target_surface

from meshot.anatomy import HEMISPHERES
from meshot.flow import Fit
from meshot.mesh import Mesh, self_intersecting_faces
from meshot.metrics import evaluate, smallest_angles
from meshot_book.flows import Leg, chain_reports, chain_trajectory

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment

LOSS_STRIDE = 10  # iterations whose losses are averaged in the record


def fit_record(leg: dict, fit: Fit, seconds: dict[str, float], mending: dict) -> dict:
    """The record of one fit: losses, distances, intersections, backtracks, seconds."""
    history = fit.history
    means = [float(np.mean(history["loss"][i : i + LOSS_STRIDE])) for i in range(0, len(history["loss"]), LOSS_STRIDE)]
    names = ("checked_iteration", "checked_loss", "checked_crossings", "backtrack_iteration", "assd", "cpu_seconds")
    return {
        "loss_function": leg["loss"],
        "loss": means,
        **{name: history[name] for name in names},
        "best_iteration": fit.best_iteration,
        "n_steps": fit.n_steps,
        "mending": mending,
        "seconds": seconds["wall"] + mending["seconds"]["wall"],
        "cpu_seconds_in_all": seconds["cpu"] + mending["seconds"]["cpu"],
    }


def quality(mesh: Mesh) -> dict[str, float]:
    """Percentiles of the smallest angles of the faces, in degrees."""
    angles = smallest_angles(mesh)
    return {f"percentile_{q}": float(np.percentile(angles, q)) for q in (0, 1, 50)}


def measured(mesh: Mesh, target: Mesh, config: dict) -> dict:
    """All metrics with their floors, and the smallest angles."""
    ruler = evaluate(mesh, target, config["n_points"], config["seed"], config["n_emd_points"])
    return {"metrics": ruler.as_dict(), "smallest_angles": quality(mesh)}


def watched_path(legs: list[Leg], mesh: Mesh) -> dict:
    """Self-intersections after every step of the sequence, and the local Jacobians of each leg along the paths."""
    with torch.no_grad():
        positions = chain_trajectory(legs, mesh.vertices)
    return {
        "crossings": [len(self_intersecting_faces(mesh.with_vertices(p))) for p in positions],
        "legs": [
            {
                "steepest": report.steepest,
                "step_times_lipschitz": report.step_times_lipschitz,
                "bound_of_step_times_lipschitz": float(leg.field.lipschitz_bound()) / leg.n_steps,
                "n_flips": report.n_flips,
                "volume_factors": [float(report.volume_factors.min()), float(report.volume_factors.max())],
            }
            for leg, report in zip(legs, chain_reports(legs, mesh.vertices), strict=True)
        ],
        "largest_move": float((positions[-1] - positions[0]).norm(dim=1).max()),
    }


def fit_chain(side: str, task: str, target: Mesh, config: dict, place: Path) -> tuple[list[Leg], Mesh, list[dict]]:
    """The legs of a task including those it continues from, its start, and the records of the fits.

    Edges of the start that the legs stretch are divided if a leg requires it. States of fits are saved in ``place``.
    """
    settings = config["tasks"][task]
    if "after" in settings:
        legs, start, records = fit_chain(side, settings["after"], target, config, place)
    else:
        legs, start, records = [], start_surface(side, config["starts"][settings["start"]]), []
    for index, leg in enumerate(settings["legs"]):
        fit, seconds = fit_leg(f"{side}_{task}_{index}", leg, carried(legs, start), target, config, place)
        # Fitted in single precision, applied in double precision.
        legs, start, mending = mended_chain(leg, [*legs, Leg(fit.field.double(), fit.n_steps)], start)
        records = [*records, fit_record(leg, fit, seconds, mending)]
    return legs, start, records


def do_task(task: str, side: str, config: dict, place: Path) -> dict:
    """All results of one task on one hemisphere."""
    settings, target = config["tasks"][task], target_surface(side)
    legs, start, fits = fit_chain(side, task, target, config, place)
    end = carried(legs, start)
    before, after = measured(start, target, config), measured(end, target, config)
    assd, crossings = (after["metrics"][name]["value"] for name in ("assd", "intersecting_faces"))
    goal, stretch = settings["goal"], settings.get("stretch")
    record = {
        "goal": goal,
        "stretch": stretch,
        "assd": assd,
        "intersecting_faces": crossings,
        "reached": assd <= goal and crossings == 0,
        "stretched": None if stretch is None else assd <= stretch and crossings == 0,
        "seconds": sum(fit["seconds"] for fit in fits),
        "cpu_seconds": sum(fit["cpu_seconds_in_all"] for fit in fits),
        "n_vertices": len(start.vertices),
        "n_faces": len(start.faces),
        "fits": fits,
        "before": before,
        "after": after,
        "path": watched_path(legs, start),
    }
    if task in config["kept"].get(side, []):
        record["stored"] = store(side, task, legs, start, target, config)
    return record


def store(side: str, task: str, legs: list[Leg], start: Mesh, target: Mesh, config: dict) -> dict:
    """Write the rounded flow, read it, and measure its result. Its start must not have divided edges."""
    files = write_flow(side, task, legs, config["velocity_step"])
    end = carried(read_flow(files, [leg.n_steps for leg in legs]), start)
    return {
        "files": files,
        "assd": closeness(end, target, config["n_points"], config["seed"]),
        "intersecting_faces": len(self_intersecting_faces(end)),
    }


def work(task: tuple[str, str], config: experiment.Config) -> dict:
    """All results of one task on one hemisphere."""
    return do_task(*task, config, config.place)


def results(rows: list[dict], config: dict) -> dict:
    """The results of both hemispheres."""
    done = {tuple(row["task"]): row["found"] for row in rows}
    return {side: {task: done[task, side] for task in config["tasks"]} for side in HEMISPHERES}


def tasks(config: dict) -> list[tuple[str, str]]:
    """All tasks on both hemispheres."""
    return [(task, side) for task in config["tasks"] for side in HEMISPHERES]


if __name__ == "__main__":
    experiment.run(__file__, tasks, work, results, "fsaverage5 (FreeSurfer): white surfaces")
