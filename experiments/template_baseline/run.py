"""Evaluate the registered mean surface on every test subject, and the surface of a perfect segmentation.

The cohorts have to be made first (``data_synth/README.md``).
"""

import dataclasses
import functools
import sys
from pathlib import Path

import numpy as np

from meshot.anatomy import HEMISPHERES
from meshot.mesh import Mesh
from meshot.metrics import evaluate
from meshot.pipeline import segmented_surface
from meshot.synth import (
    Anatomy,
    Position,
    Recipe,
    Subject,
    drawn_appearance,
    drawn_shape,
    mean_surfaces,
    participants,
    read_recipe,
    read_subject,
    simulated_scan,
    standardised,
)
from meshot.volume import transform_points
from meshot_book.statistics import short

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment

LABEL = {"left": 1, "right": 2}


def template_in_standard_space(recipe: Recipe) -> dict[str, Mesh]:
    """The white surfaces of the mean subject of a recipe, in MNI152 space, by the registration of its own scan.

    This scan is simulated and registered in the same way as those of the subjects, so that systematic effects of the
    registration are the same.
    """
    mean = mean_surfaces(drawn_shape(recipe, "template"))
    appearance = dataclasses.replace(drawn_appearance(recipe, 0), noise=0.0, bias=0.0)
    still = Position(rotation_degrees=0.0, translation_mm=0.0)
    anatomy = Anatomy(head_mm=recipe.head_mm, n_lines=recipe.n_lines)
    scan = simulated_scan(mean, anatomy, appearance, still, [recipe.seed, 0])
    standard, _ = standardised(scan, recipe.registration_mm)
    white = {side: scan.surfaces["white", side] for side in LABEL}
    return {side: mesh.with_vertices(standard.from_scanner(mesh.vertices)) for side, mesh in white.items()}


def registered_template(template: dict[str, Mesh], subject: Subject, side: str) -> Mesh:
    """The template in the scanner space of a subject, by that subject's affine registration alone."""
    mesh = template[side]
    return mesh.with_vertices(transform_points(np.linalg.inv(subject.to_standard()), mesh.vertices))


def perfect_mask_surface(subject: Subject, side: str) -> Mesh:
    """The initial surface of the true mask on the standard grid, in the scanner space of the subject."""
    labels = subject.standard_labels()
    inside = labels.with_data((labels.data == LABEL[side]).astype(np.float32))
    mesh = segmented_surface(inside).mesh
    return mesh.with_vertices(transform_points(np.linalg.inv(subject.to_standard()), mesh.vertices.double()))


MEASURED = ("assd", "hausdorff", "swd", "emd", "normals")


@functools.cache
def _template(recipe_path: Path) -> dict:
    return template_in_standard_space(read_recipe(recipe_path))


def score(task: dict, folder: Path, config: dict) -> dict:
    """The metrics of the template and of the perfect mask for one hemisphere, in scanner mm."""
    subject = read_subject(folder / task["cohort"], task["participant"])
    true = subject.surface("white", task["side"])
    guesses = {
        "template": registered_template(_template(folder / task["cohort"] / "recipe.yaml"), subject, task["side"]),
        "perfect mask": perfect_mask_surface(subject, task["side"]),
    }
    found = {}
    for name, mesh in guesses.items():
        judged = evaluate(mesh, true, config["n_points"], config["seed"], config["n_emd_points"]).as_dict()
        found[name] = {key: short(judged[key]["value"]) for key in MEASURED}
        found["floor"] = {key: short(judged[key]["floor"]) for key in MEASURED}
    return found


def summarise(scores: list[dict]) -> list[dict]:
    """ASSD over the hemispheres of each cohort and kind of subject, and the smallest difference of the two."""
    rows = []
    for cohort, kind in sorted({(s["cohort"], s["kind"]) for s in scores}):
        own = [s for s in scores if (s["cohort"], s["kind"]) == (cohort, kind)]
        row = {"cohort": cohort, "kind": kind, "hemispheres": len(own)}
        for guess in ("template", "perfect mask"):
            values = [s[guess]["assd"] for s in own]
            row |= {f"{guess} mean": float(np.mean(values)), f"{guess} sd": float(np.std(values, ddof=1))}
            row |= {f"{guess} least": min(values), f"{guess} most": max(values)}
        row["least ratio"] = min(s["template"]["assd"] / s["perfect mask"]["assd"] for s in own)
        rows.append({key: short(v) if isinstance(v, float) else v for key, v in row.items()})
    return rows


def tasks(config: dict) -> list[dict]:
    """Both hemispheres of the held-out subjects of both cohorts."""
    return [
        {"cohort": name, "participant": person.participant_id, "kind": person.kind, "side": side}
        for name in config["cohorts"]
        for person in participants(Path(config["made_in"]) / name, "test")
        for side in HEMISPHERES
    ]


def work(task: dict, config: dict) -> dict:
    """The metrics of one hemisphere."""
    return score(task, Path(config["made_in"]), config)


def results(rows: list[dict], config: dict) -> dict:
    """The metrics of all hemispheres, and their summary."""
    scores = [row["task"] | row["found"] for row in rows]
    return {"scores": scores, "summary": summarise(scores)}


if __name__ == "__main__":
    data = "synthetic cohorts adni_like and oasis_like"
    experiment.run(__file__, tasks, work, results, data, experiment.COHORTS)
