"""Losses of a mesh with all faces, or with a fixed number, drawn after the flow or before it."""

import math
from collections.abc import Callable

import numpy as np
import torch

from meshot import DiscreteMeasure, Mesh, chamfer, quasi_directions, sliced_wasserstein, varifold
from meshot.measure import varifold_sample
from meshot.mesh import face_areas, folded_sphere, icosphere, sample_locations, signed_volume
from meshot.types import Tensor


def pair_of_meshes(subdivisions: int, seed: int, config: dict) -> tuple[Mesh, Mesh]:
    """A sphere, and the analytic target, stretched and rotated by the seed, with as many faces."""
    shape = dict(config["shape"])
    generator = np.random.default_rng([seed, 0])
    stretch = 1 + shape.pop("stretch") * generator.uniform(-1, 1, 3)
    turn = np.linalg.qr(generator.standard_normal((3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    folded = folded_sphere(subdivisions, **shape)
    target = folded.with_vertices(folded.vertices @ torch.from_numpy(np.diag(stretch) @ turn.T))
    radius = (3 * float(signed_volume(target)) / (4 * math.pi)) ** (1 / 3)
    return icosphere(subdivisions, radius, dtype=torch.float32), target.to(torch.float32)


def drawn_part(mesh: Mesh, n_faces: int, generator: np.random.Generator) -> Mesh:
    """Faces drawn by area, with their corners and no other vertices."""
    drawn, _ = sample_locations(mesh, n_faces, generator)
    named, corners = mesh.faces[drawn].unique(return_inverse=True)
    return Mesh(mesh.vertices[named], corners)


def reweighted(part: Mesh, before: Mesh, normal_scale: float) -> DiscreteMeasure:
    """Drawn faces after the flow. They were drawn by area before it, so each mass is the growth of its face."""
    growth = face_areas(part) / face_areas(before)
    return DiscreteMeasure(varifold(part, normal_scale=normal_scale).points, growth / growth.sum())


def compare(loss: str, source: DiscreteMeasure, target: DiscreteMeasure, n_directions: int, seed: int) -> Tensor:
    """One of the two losses between measures."""
    if loss == "chamfer":
        return chamfer(source, target)
    directions = quasi_directions(n_directions, source.points.shape[1], seed).to(source.points)
    return sliced_wasserstein(source, target, directions)


def fit_loss(variant: str, n_supports: int, start: Mesh, target: Mesh, normal_scale: float) -> Callable:
    """A loss of the moved mesh, for a fit.

    Variants: "all" faces; faces "drawn" from the moved mesh, with gradients that stop at their areas, or go "through"
    them; or "carried", with faces drawn from the start. In the last case the fit moves all vertices, but only corners
    of drawn faces have a gradient. The result is the same as if only these corners were moved.
    """
    whole = varifold(target, normal_scale=normal_scale)

    def loss(mesh: Mesh, n_directions: int, generator: np.random.Generator) -> Tensor:
        seed = int(generator.integers(2**31))
        if variant == "all":
            return compare("sliced", varifold(mesh, normal_scale=normal_scale), whole, n_directions, seed)
        goal = varifold_sample(target, n_supports, generator, normal_scale=normal_scale)
        if variant != "carried":
            source = varifold_sample(
                mesh, n_supports, generator, normal_scale=normal_scale, detach_weights=variant == "drawn"
            )
            return compare("sliced", source, goal, n_directions, seed)
        drawn, _ = sample_locations(start, n_supports, generator)
        part, before = (Mesh(m.vertices, m.faces[drawn]) for m in (mesh, start))
        return compare("sliced", reweighted(part, before, normal_scale), goal, n_directions, seed)

    return loss
