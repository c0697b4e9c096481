"""Measure pial surfaces, thickness and four surfaces that keep apart on the held-out heads of ``people_like``.

``config.yaml`` is the protocol; it says how the cohort and the flows are made. Each head takes about two minutes of one
core. ``results.json`` has a row for every side of every head, for the flows and for the baseline, and the error of the
thickness by region.
"""

import functools
import sys
from pathlib import Path

import numpy as np

from meshot.anatomy import HEMISPHERES, Hemisphere, desikan_killiany, fsaverage5_surface
from meshot.mesh import Mesh, face_areas, self_intersecting_faces, vertex_areas, vertex_normals
from meshot.metrics import (
    Surface,
    average_surface_distance,
    cortical_thickness,
    hausdorff_distance,
    normal_agreement,
    offsets_between,
)
from meshot.model import network_digest
from meshot.pipeline import TrainedNetworks, load_networks, reconstruct, vertex_regions
from meshot.provenance import rounded
from meshot.statistics import mean_interval, paired_interval
from meshot.synth import Subject, crossing_faces, scans
from meshot.types import Array, Float

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment

#: Vertices of fsaverage5: the first ones of every true surface, in the same order.
N_TEMPLATE = 10_242
#: The least share of heads without a crossing face among their four surfaces, see the rule of the protocol.
FEWEST_APART = 0.9
MEASURES = ("assd_mm", "hausdorff90_mm", "beyond_percent", "signed_mm", "normals", "area_percent")


@functools.cache
def networks_of(config: dict) -> TrainedNetworks:
    """The networks of the package."""
    return load_networks()


@functools.cache
def heads(config: experiment.Config, split: str) -> dict[str, Subject]:
    """The heads of a split by name."""
    return {each.name: each for each in scans(config["cohort"], split) if each.participant.kind == config["kind"]}


def weighted_mean(values: Float[Array, " V"], mesh: Mesh) -> float:
    """The mean over a surface by area."""
    areas = vertex_areas(mesh).detach().numpy()
    return float(values @ areas) / float(areas.sum())


@functools.cache
def mean_thickness(config: experiment.Config) -> float:
    """The mean thickness of the training heads in mm, for the baseline."""
    found = []
    for subject in heads(config, config["baseline_split"]).values():
        for side in HEMISPHERES:
            white, pial = (subject.surface(kind, side) for kind in ("white", "pial"))
            found.append(weighted_mean(cortical_thickness(white, pial), white))
    return float(np.mean(found))


def compared(mesh: Mesh, truth: Mesh, config: dict) -> dict[str, float]:
    """The measures of a surface."""
    found, target, seed = Surface(mesh), Surface(truth), config["seed"]
    there, back = offsets_between(found, target, config["n_points"], (seed, seed + 1))
    return {
        "assd_mm": average_surface_distance(there, back),
        "hausdorff90_mm": hausdorff_distance(there, back),
        "beyond_percent": 50 * sum(float((each.distances > config["beyond_mm"]).mean()) for each in (there, back)),
        "signed_mm": float(target.signed_distances(found.sample(config["n_points"], seed).points).mean()),
        "normals": normal_agreement(there, back),
        "area_percent": 100 * float(face_areas(mesh).sum() / face_areas(truth).sum() - 1),
    }


def by_region(values: Float[Array, " V"], mesh: Mesh, template: Mesh, side: Hemisphere) -> dict[str, float]:
    """The mean of a number of vertices over each region, by area. The template lies in its true place."""
    atlas, areas = desikan_killiany(side), vertex_areas(mesh).detach().numpy()
    labels = vertex_regions(mesh, template, atlas)
    sums = np.bincount(labels, values * areas, len(atlas.names)) / np.bincount(labels, areas, len(atlas.names))
    return dict(zip(atlas.names[1:], sums[1:].tolist(), strict=True))


def measured(white: Mesh, pial: Mesh, truths: dict[str, Mesh], template: Mesh, side: Hemisphere, config: dict) -> dict:
    """All numbers of the surfaces of one side; distances in mm, in scanner space."""
    found, true = cortical_thickness(white, pial), cortical_thickness(truths["white"], truths["pial"])
    means = [weighted_mean(found, white), weighted_mean(true, truths["white"])]
    regions = [by_region(found, white, template, side), by_region(true, truths["white"], template, side)]
    return {
        "white": compared(white, truths["white"], config),
        "pial": compared(pial, truths["pial"], config),
        "thickness_mm": means[0],
        "true_thickness_mm": means[1],
        "thickness_error_mm": abs(means[0] - means[1]),
        "region_error_mm": {name: abs(regions[0][name] - value) for name, value in regions[1].items()},
        "crossing_percent": 100 * len(self_intersecting_faces(pial)) / len(pial.faces),
    }


def work(task: dict, config: experiment.Config) -> dict:
    """Both sides of one head, by the flows and by the baseline."""
    subject, networks = heads(config, config["split"])[task["subject"]], networks_of(config)
    made = reconstruct(subject.scan(), networks.segmentation, networks.system)
    four = [mesh for each in made.surfaces.values() for mesh in (each.final, each.pial)]
    sides, largest = {}, mean_thickness(config)
    for side, each in made.surfaces.items():
        truths = {kind: subject.surface(kind, side) for kind in ("white", "pial")}
        template = template_in_place(truths["white"], side)
        shifted = each.final.with_vertices(each.final.vertices + largest * vertex_normals(each.final))
        sides[side] = {
            "flows": measured(each.final, each.pial, truths, template, side, config),
            "baseline": measured(each.final, shifted, truths, template, side, config),
        }
    return rounded(
        {
            "sides": sides,
            "crossing_of_four": len(crossing_faces(four)),
            "warning_names": [warning.name for warning in made.warnings],
            "cpu_seconds": sum(made.cpu_seconds.values()),
        }
    )


def template_in_place(truth: Mesh, side: Hemisphere) -> Mesh:
    """fsaverage5's white surface where its vertices truly are: the first vertices of a true surface."""
    return fsaverage5_surface("white", side).with_vertices(truth.vertices[:N_TEMPLATE].double())


def per_head(rows: list[dict], *path: str) -> list[float]:
    """A number of every head: the mean over its sides."""
    return [float(np.mean([functools.reduce(dict.get, path, side) for side in row["sides"].values()])) for row in rows]


def interval(values: list[float]) -> dict[str, float]:
    """Mean and 95 % interval."""
    return dict(zip(("mean", "low", "high"), mean_interval(values)))


def summarised(rows: list[dict]) -> dict:
    """Means over heads, the difference to the baseline, and errors of the thickness by region."""
    found: dict = {"n_heads": len(rows)}
    for name in ("flows", "baseline"):
        found[name] = {
            kind: {key: interval(per_head(rows, name, kind, key)) for key in MEASURES} for kind in ("white", "pial")
        }
        found[name]["thickness_error_mm"] = interval(per_head(rows, name, "thickness_error_mm"))
        regions = rows[0]["sides"]["left"][name]["region_error_mm"]
        found[name]["region_error_mm"] = {
            region: float(np.mean(per_head(rows, name, "region_error_mm", region))) for region in regions
        }
    pairs = (per_head(rows, name, "pial", "assd_mm") for name in ("flows", "baseline"))
    difference = dict(zip(("mean", "low", "high"), paired_interval(*pairs)))
    apart = sum(row["crossing_of_four"] == 0 for row in rows)
    found |= {"difference_mm": difference, "n_without_crossing": apart}
    return found | {"ships": difference["high"] < 0 and apart >= FEWEST_APART * len(rows)}


@functools.cache
def digests_of(config: dict) -> dict[str, str]:
    """Of the networks."""
    networks = networks_of(config)
    parts = {"segmentation": networks.segmentation} | {k: p.network for k, p in networks.system.parts.items()}
    return {name: network_digest(each) for name, each in parts.items()}


def tasks(config: experiment.Config) -> list[dict]:
    """The held-out heads."""
    if not Path(config["cohort"]).is_dir():
        return []
    return [{"subject": name, "digests": digests_of(config)} for name in heads(config, config["split"])]


def results(rows: list[dict], config: experiment.Config) -> dict:
    """The heads, and their summary."""
    found = [{"subject": row["task"]["subject"]} | row["found"] for row in rows]
    about = {"networks": digests_of(config), "baseline_thickness_mm": mean_thickness(config)}
    return rounded(about | {"summary": summarised(found), "heads": found})


if __name__ == "__main__":
    experiment.run(__file__, tasks, work, results, "held-out heads of the recipe people_like")
