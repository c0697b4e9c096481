"""Measure ``meshot reconstruct`` on held-out heads: Dice, distances, normals and crossing faces of both sides.

The MNI152 average is measured, too.

Run as ``python experiments/people/run.py`` when the cohorts of ``config.yaml`` exist. ``--only people_like`` measures
one of them. ``--segmentation`` and ``--weights`` replace the networks of the package, ``--output`` the file of the
results. Every finished scan is stored, so that a stopped run can be resumed.
"""

import argparse
import functools
import time
from pathlib import Path

import numpy as np
import torch
import yaml
from average import measured_average
from summary import summarised

from meshot.anatomy import HEMISPHERES, Hemisphere
from meshot.jobs import run_jobs
from meshot.mesh import Mesh, face_areas, self_intersecting_faces
from meshot.metrics import Surface, average_surface_distance, hausdorff_distance, normal_agreement, offsets_between
from meshot.model import network_digest
from meshot.pipeline import Reconstruction, TrainedNetworks, load_networks, reconstruct, warning_names
from meshot.provenance import rounded, write_results
from meshot.synth import Subject, scans
from meshot.volume import Volume, dice, enclosed_fractions, transform_points

HERE = Path(__file__).resolve().parent
COMMAND = "python experiments/people/run.py"


def measured(subject: Subject, networks: TrainedNetworks, config: dict) -> dict:
    """All numbers of one scan."""
    made = reconstruct(subject.scan(), networks.segmentation, networks.system)
    sides = {side: of_side(made, subject.surface("white", side), side, config) for side in HEMISPHERES}
    return {"about": about(subject), "sides": sides, **how_it_went(made)}


def of_side(made: Reconstruction, truth: Mesh, side: Hemisphere, config: dict) -> dict:
    """Numbers of one hemisphere; distances in mm, in scanner space."""
    found = made.surfaces[side]
    standard = truth.with_vertices(transform_points(made.scan.to_standard, truth.vertices.double()))
    mask = found.segmented.mask
    n_mask, n_ball = (int(each.data.sum()) for each in (mask, found.segmented.genus_zero_mask))
    repaired = found.repaired
    return {
        "dice": dice(uncropped(mask, made.scan.volume), enclosed_fractions(standard, made.scan.volume) > 0.5),
        "given_up_percent": 100 * (n_mask - n_ball) / n_mask,
        "crossing_faces_before_repair": None if repaired is None else repaired.n_crossing,
        "initial": compared(found.initial, truth, config),
        "final": compared(found.final, truth, config),
    }


def uncropped(mask: Volume, grid: Volume) -> np.ndarray:
    """A mask of a part of a grid, on the whole grid."""
    first = np.rint(np.linalg.inv(grid.affine) @ mask.affine[:, 3]).astype(int)[:3]
    whole = np.zeros(grid.data.shape, dtype=bool)
    whole[tuple(slice(start, start + n) for start, n in zip(first, mask.data.shape))] = mask.data
    return whole


def compared(mesh: Mesh, truth: Mesh, config: dict) -> dict:
    """Metrics between a surface and the true one."""
    there, back = offsets_between(
        Surface(mesh), Surface(truth), config["n_points"], (config["seed"], config["seed"] + 1)
    )
    return {
        "assd_mm": average_surface_distance(there, back),
        "hausdorff90_mm": hausdorff_distance(there, back),
        "normals": normal_agreement(there, back),
        "crossing_faces": len(self_intersecting_faces(mesh)),
        "area_ratio": float(face_areas(mesh).sum() / face_areas(truth).sum()),
    }


def about(subject: Subject) -> dict:
    """Factor on the ventricles, which grows with age; cube root of the volume of a voxel; 1 with skull, 0 without."""
    knobs = subject.facts()["knobs"]
    return {
        "ventricles": knobs["anatomy"]["ventricles"],
        "voxel_mm": float(np.prod(knobs["position"]["voxel_mm"]) ** (1 / 3)),
        "skull": int(bool(knobs["anatomy"]["head_mm"])),
    }


def how_it_went(made: Reconstruction) -> dict:
    """Warnings of a reconstruction, and its seconds of processor time."""
    return {"warning_names": warning_names(made.warnings), "cpu_seconds": sum(made.cpu_seconds.values())}


def digests(networks: TrainedNetworks) -> dict[str, str]:
    """The digest of every network."""
    parts = networks.system.parts
    return {"segmentation": network_digest(networks.segmentation)} | {
        name: network_digest(part.network) for name, part in parts.items()
    }


def parsed(words: list[str] | None) -> argparse.Namespace:
    """The parsed command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", metavar="COHORT", help="measure these cohorts alone, and write no results")
    parser.add_argument("--segmentation", type=Path, help="weights in place of the package's")
    parser.add_argument("--weights", type=Path, help="folder of flows in place of the package's")
    parser.add_argument("--output", type=Path, default=HERE / "results.json", help="where the results go")
    return parser.parse_args(words)


def main(words: list[str] | None = None) -> None:
    """Measure all held-out scans, then write the results."""
    asked = parsed(words)
    config = yaml.safe_load((HERE / "config.yaml").read_text(encoding="utf-8"))
    torch.set_num_threads(config["n_threads"])
    files = config["networks"] | {"package": {"segmentation": asked.segmentation, "weights": asked.weights}}

    @functools.cache
    def networks(name: str) -> TrainedNetworks:
        return load_networks(weights=files[name]["weights"], segmentation=files[name]["segmentation"])

    used = {name: digests(networks(name)) for name in config["networks"]}
    cohorts = {name: config["cohorts"][name] for name in asked.only or config["cohorts"]}
    subjects = {
        f"{cohort}/{subject.name}": subject
        for cohort, folder in cohorts.items()
        for subject in scans(folder, config["split"])
        if subject.participant.kind == config["kind"]
    }
    tasks = [
        {"subject": name, "networks": which, "digests": used[which]}
        for name in subjects
        for which in config["plan"][name.split("/")[0]]
    ]

    def work(task: dict) -> dict:
        return measured(subjects[task["subject"]], networks(task["networks"]), config)

    partial = asked.output.with_name("partial.jsonl")
    rows = run_jobs(tasks, work, partial, folder=HERE, config=config, clock=time.process_time)
    if asked.only:
        return
    scanned = [{"subject": row["task"]["subject"], "networks": row["task"]["networks"]} | row["found"] for row in rows]
    average = measured_average(networks("package"), config)
    results = rounded({"networks": used, "summary": summarised(scanned, config), "average": average, "scans": scanned})
    seconds = sum(row["seconds"] for row in rows)
    data = f"held-out subjects of the synthetic cohorts {', '.join(cohorts)}"
    write_results(asked.output, results, config, COMMAND, data, seconds)
    partial.unlink()


if __name__ == "__main__":
    main()
