"""Two predictions of a subject's white surface without training."""

import dataclasses

import numpy as np

from meshot.mesh import Mesh
from meshot.pipeline import segmented_surface
from meshot.synth import (
    Anatomy,
    Position,
    Recipe,
    Subject,
    drawn_appearance,
    drawn_shape,
    mean_surfaces,
    simulated_scan,
    standardised,
)
from meshot.volume import transform_points

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
