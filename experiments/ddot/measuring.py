"""Measurements of one hemisphere of a held-out subject in scanner space: before a flow, after it, and repaired."""

import dataclasses
import time

from places import Places, places

from meshot.anatomy import Hemisphere
from meshot.flow import repair_crossings
from meshot.mesh import Mesh
from meshot.metrics import Evaluation, evaluate
from meshot.model import DeformationNetwork
from meshot.pipeline import InitialSurfaces, in_scanner
from meshot.synth import Subject
from meshot.systems import deformed
from meshot.volume import StandardScan
from meshot_book.measurements import METRICS, metric_values

FLOORS = ("emd_mm", "swd_mm", "assd_mm", "hausdorff90_mm", "normals")


@dataclasses.dataclass(frozen=True, eq=False)
class Seen:
    """A hemisphere: scan and initial surface in standard space; the true surface in scanner space, with its bins."""

    scan: StandardScan
    initial: Mesh
    truth: Places


def seen(subject: Subject, side: Hemisphere, surfaces: InitialSurfaces, settings: dict) -> Seen:
    """Read a hemisphere. Its initial surface is computed if it does not exist."""
    truth = places(subject.surface("white", side), settings)
    return Seen(subject.standard(), surfaces.of(subject, side), truth)


def initial_row(found: Seen, settings: dict) -> dict:
    """Metrics of the initial surface, floors of the metrics, and the fraction of the area in each bin."""
    evaluation = evaluated(found.initial, found, settings)
    floors = {key: getattr(evaluation, METRICS[key]).floor for key in FLOORS}
    measured = metric_values(evaluation) | found.truth.errors(in_scanner(found.initial, found.scan))
    return {"measured": measured, "floors": floors, "share": found.truth.shares(), "n_faces": len(found.initial.faces)}


def flow_row(found: Seen, network: DeformationNetwork, training: dict, settings: dict) -> dict:
    """Metrics of the surface after a flow, as it is (``flow``) and after repair of intersections (``repaired``)."""
    started = time.process_time()
    carried = deformed(found.initial, found.scan.volume, network, training["n_flow_steps"], training["method"])
    flowed = time.process_time()
    result = repair_crossings(found.initial, carried)
    seconds = {"cpu_seconds_flow": flowed - started, "cpu_seconds_repair": time.process_time() - flowed}
    last = metric_values(evaluated(result.mesh, found, settings))
    return {
        "flow": metric_values(evaluated(carried, found, settings)) if result.n_crossing else last,
        "repaired": last | found.truth.errors(in_scanner(result.mesh, found.scan)),
        "n_backtracks": result.n_backtracks,
        "largest_move_mm": result.largest_move,
    } | seconds


def evaluated(mesh: Mesh, found: Seen, settings: dict) -> Evaluation:
    """All metrics between a mesh of the standard space and the true surface, in scanner space."""
    return evaluate(
        in_scanner(mesh, found.scan), found.truth.mesh, settings["n_points"], settings["seed"],
        settings["n_emd_points"],
    )  # fmt: skip
