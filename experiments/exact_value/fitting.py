"""Descent of a sphere to a folded surface by the exact loss, and by two discrete ones with as many support points."""

import numpy as np
import torch

from meshot import DiscreteMeasure, Mesh, empirical, quasi_directions, random_directions, sliced_wasserstein, surface
from meshot.mesh import face_areas, face_barycentres, folded_sphere, icosphere
from meshot.metrics import Surface, average_surface_distance
from meshot.types import Tensor

ENCODINGS = ("continuous", "barycentres", "samples")


def descents(config: dict) -> list[dict]:
    """For every encoding and seed: the distance from the target at the start and at the end."""
    return [descend_once(encoding, seed, config) for encoding in ENCODINGS for seed in config["descent"]["seeds"]]


def descend_once(encoding: str, seed: int, config: dict) -> dict:
    """Free vertices, Adam with a cosine schedule, new directions at every step, no regulariser."""
    settings = config["descent"]
    start = icosphere(settings["source_subdivisions"], 40.0)
    target = folded_sphere(settings["target_subdivisions"], 40.0, settings["depth"])
    generator = np.random.default_rng([seed, 3])
    vertices = start.vertices.clone().requires_grad_()
    optimiser = torch.optim.Adam([vertices], lr=settings["rate"])
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, settings["n_steps"])
    for _ in range(settings["n_steps"]):
        directions = random_directions(config["n_directions"], 3, generator)
        pair = [
            _encoded(mesh, encoding, len(start.faces), generator) for mesh in (start.with_vertices(vertices), target)
        ]
        optimiser.zero_grad()
        sliced_wasserstein(*pair, directions).backward()
        optimiser.step()
        schedule.step()
    end = start.with_vertices(vertices.detach())
    before, after = (_judged(mesh, target, settings) for mesh in (start, end))
    return {"encoding": encoding, "seed": seed, "start": before, "end": after}


def _encoded(mesh: Mesh, encoding: str, n_points: int, generator: np.random.Generator) -> object:
    """The encoding of a mesh. Samples have as many points as the moving mesh has faces, on either side."""
    if encoding == "continuous":
        return surface(mesh)
    if encoding == "samples":
        return empirical(mesh, n_points, generator, detach_weights=True)
    areas: Tensor = face_areas(mesh)
    return DiscreteMeasure(face_barycentres(mesh), areas / areas.sum())


def _judged(mesh: Mesh, target: Mesh, settings: dict) -> dict:
    """The exact SW₂ along directions not used in the descent, and the mean distance to the other's faces, in mm."""
    directions = quasi_directions(settings["n_judging_directions"], 3, seed=1)
    squared = float(sliced_wasserstein(surface(mesh), surface(target), directions))
    sides = Surface(mesh), Surface(target)
    samples = [side.sample(20_000, seed) for seed, side in enumerate(sides)]
    distance = average_surface_distance(sides[1].offsets(samples[0]), sides[0].offsets(samples[1]))
    return {"sliced_distance": squared**0.5, "surface_distance": distance}
