"""How near a surface from the true fractions comes to the truth, over the size of the voxels.

The cohort has to be made first (``data_synth/README.md``).
"""

import functools
import sys
import time
from pathlib import Path

import numpy as np
import torch

from meshot.mesh import Mesh, topology
from meshot.metrics import Surface, average_surface_distance, hausdorff_distance, offsets_between
from meshot.pipeline import segmented_surface
from meshot.provenance import rounded
from meshot.synth import Subject, scans
from meshot.volume import Volume, enclosed_fractions

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment

MEASURED = ("assd_mm", "hausdorff90_mm", "assd_mm_raw", "given_up_mm3", "n_faces", "n_voxels", "cpu_seconds")


def grid_around(mesh: Mesh, voxel: float, margin: float) -> Volume:
    """An empty grid of cubic voxels (mm) around a mesh, with a margin (mm)."""
    low, high = (f(mesh.vertices, dim=0).values.numpy() for f in (torch.min, torch.max))
    shape = np.ceil((high - low + 2 * margin) / voxel).astype(int) + 1
    affine = np.diag([voxel, voxel, voxel, 1.0])
    affine[:3, 3] = low - margin
    return Volume(np.zeros(tuple(int(n) for n in shape)), affine)


def measured(truth: Mesh, voxel: float, config: dict) -> dict:
    """The distances of the surface from the true fractions on such a grid, and what it costs."""
    grid = grid_around(truth, voxel, config["margin_mm"])
    fractions, started = enclosed_fractions(truth, grid), time.process_time()
    surface = segmented_surface(grid.with_data(fractions))
    seconds = time.process_time() - started
    n_given_up = int(surface.mask.data.sum()) - int(surface.genus_zero_mask.data.sum())
    there, back = _offsets(surface.mesh, truth, config)
    return {
        "assd_mm": average_surface_distance(there, back),
        "hausdorff90_mm": hausdorff_distance(there, back),
        "assd_mm_raw": average_surface_distance(*_offsets(surface.raw_mesh, truth, config)),
        "given_up_mm3": n_given_up * voxel**3,
        "n_faces": len(surface.mesh.faces),
        "n_voxels": fractions.size,
        "cpu_seconds": seconds,
        "euler_number": topology(surface.mesh).euler_number,
    }


def _offsets(found: Mesh, truth: Mesh, config: dict) -> tuple:
    return offsets_between(Surface(found), Surface(truth), config["n_points"], (config["seed"], config["seed"] + 1))


def summary(rows: list[dict]) -> list[dict]:
    """For every voxel size the mean of each number over the hemispheres, and the standard deviation of the ASSD."""
    found = []
    for voxel in dict.fromkeys(row["voxel_mm"] for row in rows):
        own = [row for row in rows if row["voxel_mm"] == voxel]
        found.append({"voxel_mm": voxel, "n_hemispheres": len(own)})
        found[-1] |= {key: float(np.mean([row[key] for row in own])) for key in MEASURED}
        found[-1]["assd_mm_sd"] = float(np.std([row["assd_mm"] for row in own], ddof=1))
    return found


def exponent(lines: list[dict]) -> float:
    """The slope of the mean ASSD over the voxel size between logarithms, by least squares."""
    sizes, values = (np.log([line[key] for line in lines]) for key in ("voxel_mm", "assd_mm"))
    return float(np.polyfit(sizes, values, 1)[0])


def chosen(subjects: list[Subject], config: dict) -> dict[str, Subject]:
    """The first held-out subjects of the kind that is measured, by name."""
    own = [each for each in subjects if each.participant.kind == config["kind"]]
    return {each.name: each for each in own[: config["n_subjects"]]}


def tasks(config: dict) -> list[dict]:
    """Both hemispheres of the subjects, with every size of the voxels."""
    return [
        {"subject": name, "side": side, "voxel_mm": voxel}
        for name in people(config) for side in config["sides"] for voxel in config["voxel_mm"]
    ]  # fmt: skip


@functools.cache
def people(config: dict) -> dict[str, Subject]:
    """The subjects that are measured."""
    return chosen(scans(Path(config["made_in"]) / config["cohort"], "test"), config)


@functools.lru_cache(maxsize=1)
def truth_of(name: str, side: str, config: dict) -> Mesh:
    """The true surface, in scanner space, in mm."""
    return people(config)[name].surface("white", side)


def work(task: dict, config: dict) -> dict:
    """What was measured for one size of the voxels."""
    return measured(truth_of(task["subject"], task["side"], config), task["voxel_mm"], config)


def results(rows: list[dict], config: dict) -> dict:
    """The rows, their means, and the exponent."""
    rows = [row["task"] | row["found"] for row in rows]
    lines = summary(rows)
    return rounded({"hemispheres": rows, "summary": lines, "exponent": exponent(lines)})


def data(config: dict) -> str:
    """The subjects."""
    return f"held-out subjects of the synthetic cohort {config['cohort']}"


if __name__ == "__main__":
    experiment.run(__file__, tasks, work, results, data, experiment.COHORTS)
