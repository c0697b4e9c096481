"""Measurements of held-out subjects in scanner space: of one scan, and of two scans of one subject."""

import sys
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np

from meshot.mesh import Mesh
from meshot.metrics import Evaluation, evaluate, rigidly_aligned
from meshot_book.measurements import metric_values

sys.path.append(str(Path(__file__).resolve().parents[1]))
from trials.scanned import Found, Seen

PAIR_METRICS = ("emd_mm", "swd_mm", "assd_mm")
#: The arm of a perfect surface: the floors of the metrics.
PERFECT = "perfect"


def subject_rows(scan: Seen, found: Found, sides: tuple[str, ...], settings: dict) -> list[dict]:
    """The metrics of the found surfaces of each side, or why a system found none."""
    surfaces, seconds = found
    if isinstance(surfaces, str):
        return [{"side": side, "failed": surfaces} for side in sides]
    return [
        {"side": side, "cpu_seconds": seconds} | metric_values(_evaluated(surfaces[side], scan.truths[side], settings))
        for side in sides
    ]


def floor_rows(scan: Seen, settings: dict) -> list[dict]:
    """What a perfect surface scores: the floors of the metrics, and the crossing faces of the true surface."""
    evaluations = {side: _evaluated(truth, truth, settings, floors=True) for side, truth in scan.truths.items()}
    return [{"side": side} | metric_values(found, "floor") for side, found in evaluations.items()]


def pair_rows(pair: tuple[Seen, Seen], found: Callable[[Seen], Found], sides: tuple[str, ...], config: dict) -> list:
    """How well two scans of one subject agree, after the second surface is aligned with the first by ICP.

    ``icp_residue_mm`` is the residue of the alignment. ``rigid_residue_mm`` is the error of its motion: the root mean
    squared distance between corresponding vertices of both true surfaces, after the second has made the same motion.
    ICP stops after at most 100 ``icp_steps``.
    """
    surfaces = [found(scan)[0] for scan in pair]
    if any(isinstance(each, str) for each in surfaces):
        why = next(each for each in surfaces if isinstance(each, str))
        return [{"side": side, "failed": why} for side in sides]
    settings, rows = config["evaluation"], []
    for side in sides:
        first, second = (each[side] for each in surfaces)
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "the points still move")  # the number of steps tells it
            moved = rigidly_aligned(second, first, config["consistency"]["n_points"], settings["seed"])
        numbers = metric_values(_evaluated(moved.mesh, first, settings))
        here, there = (scan.truths[side].vertices.double().numpy() for scan in pair)
        apart = there @ moved.rotation.T + moved.translation - here
        residues = {"icp_residue_mm": moved.residue, "rigid_residue_mm": float(np.sqrt((apart**2).sum(1).mean()))}
        residues["icp_steps"] = len(moved.residues) - 1
        rows.append({"side": side} | {name: numbers[name] for name in PAIR_METRICS} | residues)
    return rows


def _evaluated(mesh: Mesh, truth: Mesh, settings: dict, floors: bool = False) -> Evaluation:
    return evaluate(mesh, truth, settings["n_points"], settings["seed"], settings["n_emd_points"], floors=floors)
