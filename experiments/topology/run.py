"""Measure what the correction of topology gives up, and what that costs before and after the flow.

``config.yaml`` is the protocol. The cohort is made as ``experiments/thickness/config.yaml`` says. Each head takes some
forty seconds of one core. ``results.json`` has a row for every side of every head and every variant.
"""

import functools
import sys
from pathlib import Path

import numpy as np
import torch

from meshot.anatomy import HEMISPHERES
from meshot.mesh import Mesh, face_areas, self_intersecting_faces, signed_volume
from meshot.metrics import Surface, average_surface_distance, offsets_between
from meshot.model import network_digest
from meshot.pipeline import TrainedNetworks, in_scanner, load_networks, segment, segmented_surface
from meshot.provenance import rounded
from meshot.statistics import mean_interval, paired_interval
from meshot.synth import Subject, scans
from meshot.systems import Scan
from meshot.volume import enclosed_fractions

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment

MEASURES = ("assd_mm", "beyond_percent", "area_percent", "volume_percent")


@functools.cache
def networks() -> TrainedNetworks:
    """Those of the package."""
    return load_networks()


@functools.cache
def heads(config: experiment.Config) -> dict[str, Subject]:
    """The heads by name."""
    own = scans(config["cohort"], config["split"])
    return {each.name: each for each in own if each.participant.kind == config["kind"]}


def compared(mesh: Mesh, truth: Mesh, config: dict) -> dict[str, float]:
    """The measures of a surface."""
    there, back = offsets_between(
        Surface(mesh), Surface(truth), config["n_points"], (config["seed"], config["seed"] + 1)
    )
    return {
        "assd_mm": average_surface_distance(there, back),
        "beyond_percent": 50 * sum(float((each.distances > config["beyond_mm"]).mean()) for each in (there, back)),
        "area_percent": 100 * float(face_areas(mesh).sum() / face_areas(truth).sum() - 1),
        "volume_percent": 100 * float(signed_volume(mesh) / signed_volume(truth) - 1),
        "crossing_percent": 100 * len(self_intersecting_faces(mesh)) / len(mesh.faces),
    }


def work(task: dict, config: experiment.Config) -> dict:
    """Both sides of one head with every variant."""
    subject = heads(config)[task["subject"]]
    standard = subject.standard()
    probability, found = segment(standard.volume, networks().segmentation), {}
    image = standard.volume.with_data(standard.volume.data.astype(np.float32))
    truths = {side: subject.surface("white", side) for side in HEMISPHERES}
    for name, settings in config["variants"].items():
        made = {side: segmented_surface(probability[side], **settings) for side in HEMISPHERES}
        scan = Scan(image, {(side, "white"): each.mesh for side, each in made.items()})
        for side, each in made.items():
            given_up = each.mask.data & ~each.genus_zero_mask.data
            inside = enclosed_fractions(subject.surface("white", side, "standard"), each.mask)[given_up] > 0.5
            surfaces = {"initial": each.mesh, "flow": networks().system.white_surface(scan, side)}
            found[f"{name} {side}"] = {
                "variant": name,
                "given_up_percent": 100 * float(given_up.sum() / each.mask.data.sum()),
                "truly_white_percent": 100 * float(inside.mean()),
            } | {
                stage: compared(in_scanner(mesh.to("cpu", torch.float64), standard), truths[side], config)
                for stage, mesh in surfaces.items()
            }
    return rounded(found)


def summarised(rows: list[dict], config: dict) -> dict:
    """Means over heads of the means of both sides, and the difference of the last variant to the first."""
    found = {}
    for name in config["variants"]:
        per_head = [[each for each in row["found"].values() if each["variant"] == name] for row in rows]

        def values(*path: str, per_head: list = per_head) -> list[float]:
            return [float(np.mean([functools.reduce(dict.get, path, side) for side in sides])) for sides in per_head]

        found[name] = {key: interval(values(key)) for key in ("given_up_percent", "truly_white_percent")}
        for stage in ("initial", "flow"):
            found[name][stage] = {key: interval(values(stage, key)) for key in (*MEASURES, "crossing_percent")}
            found[name][stage]["values_mm"] = values(stage, "assd_mm")
    first, *_, last = config["variants"]
    pairs = (found[name]["flow"]["values_mm"] for name in (last, first))
    return found | {"difference_mm": dict(zip(("mean", "low", "high"), paired_interval(*pairs)))}


def interval(values: list[float]) -> dict[str, float]:
    """Mean and 95 % interval."""
    return dict(zip(("mean", "low", "high"), mean_interval(values)))


def tasks(config: experiment.Config) -> list[dict]:
    """The heads."""
    if not Path(config["cohort"]).is_dir():
        return []
    parts = {"segmentation": networks().segmentation} | {k: p.network for k, p in networks().system.parts.items()}
    digests = {name: network_digest(each) for name, each in parts.items() if "pial" not in name}
    return [{"subject": name, "digests": digests} for name in heads(config)]


def results(rows: list[dict], config: experiment.Config) -> dict:
    """The summary, and a row for every head, variant and side."""
    flat = [{"subject": row["task"]["subject"]} | row["found"] for row in rows]
    return rounded({"networks": rows[0]["task"]["digests"], "summary": summarised(rows, config), "heads": flat})


if __name__ == "__main__":
    experiment.run(__file__, tasks, work, results, "held-out heads of the recipe people_like")
