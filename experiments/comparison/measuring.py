"""Measurements of held-out subjects in scanner space: of one scan, and of two scans of one subject."""

import dataclasses
import time
import warnings
from collections.abc import Callable

import numpy as np

from meshot.anatomy import HEMISPHERES
from meshot.files import write_whole
from meshot.mesh import Mesh
from meshot.metrics import Evaluation, evaluate, rigidly_aligned
from meshot.pipeline import InitialSurfaces, in_scanner
from meshot.synth import Subject
from meshot.systems import Scan, SurfaceSystem
from meshot.volume import StandardScan
from meshot_book.measurements import metric_values

PAIR_METRICS = ("emd_mm", "swd_mm", "assd_mm")
#: The arm of the initial surface, and that of a perfect surface: the floors of the metrics.
INITIAL, PERFECT = "initial", "perfect"

#: Surfaces by side in scanner space, or why there are none, and the processor seconds of one side.
Found = tuple[dict[str, Mesh] | str, float | None]


@dataclasses.dataclass(frozen=True, eq=False)
class Seen:
    """One scan: on the standard grid, with the initial surfaces of both sides, and the true ones in scanner space."""

    scan: StandardScan
    initial: dict[str, Mesh]
    truths: dict[str, Mesh]
    seconds: float | None

    def given(self, system: type[SurfaceSystem]) -> Scan:
        """The input of a system."""
        return Scan(self.scan.volume, {key: self.initial[key[0]] for key in system.needs})


def seen(subject: Subject, surfaces: InitialSurfaces) -> Seen:
    """Read one scan. Initial surfaces that do not exist are computed; their seconds are those of one side.

    The seconds are stored beside the surfaces. Without the file there are none for surfaces that exist.
    """
    scan, started = subject.standard(), time.process_time()
    surface = surfaces.path(subject, "left", scan)
    there, file = surface.is_file(), surface.with_name(f"{surface.name}.seconds")
    initial = {side: surfaces.of(subject, side) for side in HEMISPHERES}
    if not there:
        write_whole(file, repr((time.process_time() - started) / len(HEMISPHERES)))
    seconds = float(file.read_text(encoding="utf-8")) if file.is_file() else None
    return Seen(scan, initial, {side: subject.surface("white", side) for side in HEMISPHERES}, seconds)


def reconstructed(scan: Seen, system: SurfaceSystem | None) -> Found:
    """The white surfaces of a system, without the repair of crossing faces; without a system, of the segmentation."""
    if system is None:
        return {side: in_scanner(mesh, scan.scan) for side, mesh in scan.initial.items()}, scan.seconds
    started = time.process_time()
    try:
        found = system.reconstruct(scan.given(type(system)))
    except ValueError as error:
        return str(error), None
    seconds = time.process_time() - started
    white = {side: in_scanner(mesh, scan.scan) for (side, kind), mesh in found.items() if kind == "white"}
    return white, seconds / len(white)


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
