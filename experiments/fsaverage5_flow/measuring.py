"""The measurements of a sequence of fitted flows."""

import numpy as np
import torch

from meshot.flow import Fit
from meshot.mesh import Mesh, self_intersecting_faces
from meshot.metrics import evaluate, smallest_angles
from meshot_book.flows import Leg, chain_reports, chain_trajectory

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
