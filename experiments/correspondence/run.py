"""Measure how near the vertices of the carried template come to their true places in held-out subjects.

And what that does to numbers by region: the true surfaces are divided by the carried template, and by the true places.

The cohort has to be made first (``data_synth/README.md``).
"""

import sys
from pathlib import Path

import numpy as np
import torch

from meshot.anatomy import Hemisphere, desikan_killiany, fsaverage5_surface
from meshot.mesh import Mesh
from meshot.pipeline import carry_template, region_numbers, vertex_regions
from meshot.provenance import rounded
from meshot.synth import participants, read_subject
from meshot.types import Array, Float

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment


def score(task: dict, folder: Path, config: dict) -> dict:
    """Distances of the vertices from their true places, in mm, and those of the surfaces, for one hemisphere."""
    subject = read_subject(folder / config["cohort"], task["participant"])
    surface, pial = (subject.surface(kind, task["side"], "standard") for kind in ("white", "pial"))
    template = fsaverage5_surface("white", task["side"], "MNI152")
    # The first vertices of a refined surface are those of the surface that was refined.
    truth = surface.vertices[: len(template.vertices)].double().numpy()
    carried, true_places = carry_template(surface, task["side"]), template.with_vertices(torch.from_numpy(truth))
    found = {"carried": carried.mesh, "registered": template, "best affine": best_affine(template, truth)}
    distances = {name: np.linalg.norm(mesh.vertices.numpy() - truth, axis=1) for name, mesh in found.items()}
    return {
        "vertices_mm": {name: spread(values, config["percentile"]) for name, values in distances.items()},
        "surface_mm": carried.distance_mm,
        "crossing_before": carried.n_crossing_before,
        "crossing": carried.n_crossing,
        "regions": by_region(surface, pial, true_places, carried.mesh, task["side"]),
    }


def by_region(white: Mesh, pial: Mesh, truth: Mesh, carried: Mesh, side: Hemisphere) -> dict:
    """How many vertices have their true region, and by region area and thickness minus the true ones.

    Both divisions are of the same true surfaces, so that only the correspondence differs.
    """
    atlas = desikan_killiany(side)
    labels = {"true": vertex_regions(white, truth, atlas), "found": vertex_regions(white, carried, atlas)}
    rows = {
        key: {row["region"]: row for row in region_numbers(white, each, atlas, pial)} for key, each in labels.items()
    }
    true, found = rows["true"], rows["found"]
    areas = {name: found.get(name, {"area_mm2": 0.0})["area_mm2"] / row["area_mm2"] for name, row in true.items()}
    return {
        "right_percent": 100 * float((labels["true"] == labels["found"]).mean()),
        "area_percent": {name: 100 * (ratio - 1) for name, ratio in areas.items()},
        "thickness_mm": {
            name: found[name]["thickness_mm"] - row["thickness_mm"] for name, row in true.items() if name in found
        },
    }


def best_affine(template: Mesh, truth: Float[Array, "V 3"]) -> Mesh:
    """The template after the affine map that brings its vertices nearest to their true places."""
    extended = np.column_stack([template.vertices.numpy(), np.ones(len(truth))])
    solution = np.linalg.lstsq(extended, truth, rcond=None)[0]
    return template.with_vertices(torch.from_numpy(extended @ solution))


def spread(distances: Float[Array, " V"], percentile: float) -> dict[str, float]:
    """The mean, the median and a percentile."""
    return {
        "mean": float(distances.mean()),
        "median": float(np.median(distances)),
        f"percentile_{percentile:g}": float(np.percentile(distances, percentile)),
    }


#: By region: found minus true.
ERRORS = ("area_percent", "thickness_mm")


def mean_errors(found: list[dict[str, float]]) -> dict[str, float]:
    """The mean absolute error of each region over the hemispheres in which it was found."""
    return {name: float(np.mean([abs(each[name]) for each in found if name in each])) for name in found[0]}


def means(scores: list[dict]) -> dict:
    """The mean of each number over the hemispheres."""
    return {
        "hemispheres": len(scores),
        "surface_mm": float(np.mean([each["surface_mm"] for each in scores])),
        "crossing_before": float(np.mean([each["crossing_before"] for each in scores])),
        "crossing": float(np.mean([each["crossing"] for each in scores])),
        "regions": {
            "right_percent": float(np.mean([each["regions"]["right_percent"] for each in scores])),
            **{f"{key}_error": mean_errors([each["regions"][key] for each in scores]) for key in ERRORS},
        },
        "vertices_mm": {
            name: {key: float(np.mean([each["vertices_mm"][name][key] for each in scores])) for key in found}
            for name, found in scores[0]["vertices_mm"].items()
        },
    }


def tasks(config: dict) -> list[dict]:
    """Both hemispheres of the held-out subjects."""
    return [
        {"participant": person.participant_id, "side": side}
        for person in participants(Path(config["made_in"]) / config["cohort"], "test")
        for side in config["sides"]
        if person.kind == config["kind"] and not person.participant_id.startswith("sub-h")  # those were added later
    ]


def work(task: dict, config: dict) -> dict:
    """The distances of one hemisphere."""
    return score(task, Path(config["made_in"]), config)


def results(rows: list[dict], config: dict) -> dict:
    """The distances of all hemispheres, and their means."""
    scores = [row["task"] | row["found"] | {"cpu_seconds": round(row["seconds"], 1)} for row in rows]
    return rounded({"scores": scores, "means": means(scores)})


def data(config: dict) -> str:
    """The cohort."""
    return f"synthetic cohort {config['cohort']}"


if __name__ == "__main__":
    experiment.run(__file__, tasks, work, results, data, experiment.COHORTS)
