"""Results of the segmentation network and of the initial surfaces on held-out subjects.

Run as ``python experiments/segmentation/run.py`` when both cohorts and the weights exist; ``--cohorts``, ``--weights``
and ``--output`` replace the configured ones. Every finished hemisphere is stored in a file beside the output, so that a
stopped run can be resumed.
"""

import argparse
import dataclasses
import functools
import time
from pathlib import Path

import numpy as np
import torch
import yaml
from summary import summary

from meshot.anatomy import HEMISPHERES
from meshot.jobs import run_jobs
from meshot.mesh import self_intersecting_faces, topology
from meshot.metrics import Surface, average_surface_distance, hausdorff_distance, offsets_between
from meshot.model import SegmentationNetwork, network_digest, read_weights
from meshot.pipeline import in_scanner, segment, segmented_surface
from meshot.provenance import write_results
from meshot.synth import Subject, scans
from meshot.volume import Volume, dice, enclosed_fractions, isosurface

HERE = Path(__file__).parent


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


def parsed(words: list[str] | None) -> argparse.Namespace:
    """The parsed command line, with defaults from the configuration."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cohorts", nargs="+", help="folders, in place of those of config.yaml")
    parser.add_argument("--weights", help="a file, in place of that of config.yaml")
    parser.add_argument("--output", default=HERE / "results.json", type=Path, help="where the results go")
    return parser.parse_args(words)


def main(words: list[str] | None = None) -> None:
    """Measure all held-out hemispheres, then write the results."""
    asked = parsed(words)
    config = yaml.safe_load((HERE / "config.yaml").read_text(encoding="utf-8"))
    config |= {key: value for key in ("cohorts", "weights") if (value := getattr(asked, key)) is not None}
    torch.set_num_threads(config["n_threads"])
    network, record = read_weights(config["weights"], SegmentationNetwork)
    subjects = {f"{Path(c).name}/{s.name}": s for c in config["cohorts"] for s in scans(c, config["split"])}

    @functools.lru_cache(maxsize=1)
    def seen(name: str) -> Seen:
        scan, started = subjects[name].standard(), time.process_time()
        return Seen(scan, segment(scan.volume, network), time.process_time() - started)

    def work(task: dict) -> dict:
        found = seen(task["subject"])
        return measured(subjects[task["subject"]], task["side"], found, config["n_points"], config["seed"])

    tasks = [{"subject": name, "side": side} for name in subjects for side in HEMISPHERES]
    partial = asked.output.with_suffix(".partial")
    made_with = config | {"weights": network_digest(network)}
    rows = run_jobs(tasks, work, partial, folder=HERE, config=made_with, clock=time.process_time)
    hemispheres = [row["task"] | row["found"] for row in rows]
    results = {"hemispheres": hemispheres, "summary": summary(hemispheres), "weights": described(network, record)}
    seconds = sum(row["seconds"] for row in rows)
    write_results(
        asked.output, results, config, "python experiments/segmentation/run.py", data_of(config["cohorts"]), seconds
    )
    partial.unlink()


def described(network: SegmentationNetwork, record: dict) -> dict:
    """The origin of the weights."""
    kept = {key: record[key] for key in ("command", "commit", "date", "network", "training", "cohorts", "machine")}
    about = {key: record["results"][key] for key in ("best_step", "n_steps", "cpu_seconds", "data")}
    return kept | about | {"n_weights": sum(p.numel() for p in network.parameters())}


def data_of(cohorts: list[str]) -> str:
    """A description of the data."""
    return f"held-out subjects of the synthetic cohorts {', '.join(Path(cohort).name for cohort in cohorts)}"


if __name__ == "__main__":
    main()
