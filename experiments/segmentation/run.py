"""Results of the segmentation network and of the initial surfaces on held-out subjects.

Both cohorts and the weights have to be made first.
"""

import dataclasses
import functools
import sys
import time
from pathlib import Path

import numpy as np

from meshot.anatomy import HEMISPHERES
from meshot.mesh import self_intersecting_faces, topology
from meshot.metrics import Surface, average_surface_distance, hausdorff_distance, offsets_between
from meshot.model import SegmentationNetwork, network_digest, read_weights
from meshot.pipeline import in_scanner, segment, segmented_surface
from meshot.synth import Subject, scans
from meshot.volume import Volume, dice, enclosed_fractions, isosurface

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment

#: Targets for every held-out subject.
LEAST_DICE, LARGEST_ASSD_MM = 0.95, 0.6


def summary(hemispheres: list[dict]) -> list[dict]:
    """One row per cohort and kind. ``all_spheres`` requires that all defect counts are zero and all χ are 2."""
    groups: dict[tuple[str, str], list[dict]] = {}
    for row in hemispheres:
        groups.setdefault((row["subject"].split("/")[0], row["kind"]), []).append(row)
    return [_row(cohort, kind, rows) for (cohort, kind), rows in groups.items()]


def _row(cohort: str, kind: str, rows: list[dict]) -> dict:
    def values(name: str) -> list[float]:
        return [row[name] for row in rows]

    return {
        "cohort": cohort,
        "kind": kind,
        "n_hemispheres": len(rows),
        "median_dice": float(np.median(values("dice"))),
        "least_dice": min(values("dice")),
        "median_assd_mm": float(np.median(values("assd_mm"))),
        "largest_assd_mm": max(values("assd_mm")),
        "median_assd_mm_from_truth": float(np.median([row["from_truth_alone"]["assd_mm"] for row in rows])),
        "all_spheres": all(is_sphere(row) for row in rows),
        "n_self_intersecting": sum(row["self_intersecting_faces"] > 0 for row in rows),
        "n_below_dice": sum(row["dice"] < LEAST_DICE for row in rows),
        "n_above_assd": sum(row["assd_mm"] > LARGEST_ASSD_MM for row in rows),
    }


def is_sphere(row: dict) -> bool:
    """Whether the surface is one closed, manifold component of Euler number 2."""
    counts = (row["euler_number"], row["components"], row["nonmanifold_edges"], row["boundary_edges"])
    return counts == (2, 1, 0, 0)


@dataclasses.dataclass(frozen=True, eq=False)
class Seen:
    """A subject's scan and the output of the network, stored while both hemispheres are measured."""

    scan: object
    probability: dict[str, Volume]
    seconds: float


def measured(subject: Subject, side: str, seen: Seen, n_points: int, seed: int) -> dict:
    """All numbers of one hemisphere; distances in mm, in scanner space."""
    started = time.process_time()
    surface = segmented_surface(seen.probability[side])
    mesh = in_scanner(surface.mesh, seen.scan)
    seconds = time.process_time() - started
    truth = subject.surface("white", side)
    fractions = enclosed_fractions(subject.surface("white", side, "standard"), seen.scan.volume)
    before, after = topology(isosurface(surface.mask.with_data(surface.mask.data.astype(float)))), topology(mesh)
    n_mask, n_ball = int(surface.mask.data.sum()), int(surface.genus_zero_mask.data.sum())
    there, back = offsets_between(Surface(mesh), Surface(truth), n_points, (seed, seed + 1))
    return {
        "kind": subject.participant.kind,
        "dice": dice(seen.probability[side].data > 0.5, fractions > 0.5),
        "mean_absolute_error_of_fractions": float(
            np.abs(seen.probability[side].data - fractions)[fractions > 0].mean()
        ),
        "n_voxels": n_mask,
        "n_voxels_given_up": n_mask - n_ball,
        "euler_number_of_mask": before.euler_number,
        "nonmanifold_edges_of_mask": before.n_nonmanifold_edges,
        "n_faces": len(mesh.faces),
        "euler_number": after.euler_number,
        "components": after.n_components,
        "nonmanifold_edges": after.n_nonmanifold_edges,
        "boundary_edges": after.n_boundary_edges,
        "self_intersecting_faces": len(self_intersecting_faces(mesh)),
        "assd_mm": average_surface_distance(there, back),
        "hausdorff90_mm": hausdorff_distance(there, back),
        "from_truth_alone": from_truth(subject, side, seen.scan, fractions, n_points, seed),
        "cpu_seconds_network": seen.seconds,
        "cpu_seconds_surface": seconds,
    }


def from_truth(subject: Subject, side: str, scan: object, fractions: np.ndarray, n_points: int, seed: int) -> dict:
    """The same computation from the true fractions: the error of the grid itself, without a network."""
    surface = segmented_surface(scan.volume.with_data(fractions))
    found, goal = Surface(in_scanner(surface.mesh, scan)), Surface(subject.surface("white", side))
    there, back = offsets_between(found, goal, n_points, (seed, seed + 1))
    n_given_up = int(surface.mask.data.sum() - surface.genus_zero_mask.data.sum())
    return {"assd_mm": average_surface_distance(there, back), "n_voxels_given_up": n_given_up}


@functools.cache
def trained(config: dict) -> tuple[SegmentationNetwork, dict]:
    """The network and the record of its training."""
    return read_weights(config["weights"], SegmentationNetwork)


@functools.cache
def subjects(config: dict) -> dict[str, Subject]:
    """The held-out scans."""
    return {f"{Path(c).name}/{s.name}": s for c in config["cohorts"] for s in scans(c, config["split"])}


@functools.lru_cache(maxsize=1)
def seen(name: str, config: dict) -> Seen:
    """A scan and what the network says."""
    scan, started = subjects(config)[name].standard(), time.process_time()
    return Seen(scan, segment(scan.volume, trained(config)[0]), time.process_time() - started)


def tasks(config: dict) -> list[dict]:
    """Both hemispheres of all scans."""
    return [{"subject": name, "side": side} for name in subjects(config) for side in HEMISPHERES]


def work(task: dict, config: dict) -> dict:
    """All numbers of one hemisphere."""
    name, side = task["subject"], task["side"]
    return measured(subjects(config)[name], side, seen(name, config), config["n_points"], config["seed"])


def results(rows: list[dict], config: dict) -> dict:
    """All hemispheres, their summary, and the origin of the weights."""
    hemispheres = [row["task"] | row["found"] for row in rows]
    return {"hemispheres": hemispheres, "summary": summary(hemispheres), "weights": described(*trained(config))}


def described(network: SegmentationNetwork, record: dict) -> dict:
    """The origin of the weights."""
    kept = {key: record[key] for key in ("command", "commit", "date", "network", "training", "cohorts", "machine")}
    about = {key: record["results"][key] for key in ("best_step", "n_steps", "cpu_seconds", "data")}
    return kept | about | {"n_weights": sum(p.numel() for p in network.parameters())}


def data(config: dict) -> str:
    """A description of the data."""
    return f"held-out subjects of the synthetic cohorts {', '.join(Path(cohort).name for cohort in config['cohorts'])}"


def depends(config: dict) -> dict:
    """The configuration with the digest of the weights in place of the name of their file."""
    return config | {"weights": network_digest(trained(config)[0])}


def main(words: list[str] | None = None) -> None:
    """Do what the command line asks."""
    experiment.run(__file__, tasks, work, results, data, depends=depends, words=words)


if __name__ == "__main__":
    main()
