"""Descent of a polygon to a star, with enough corners or too few, for several kinds of gradient."""

from collections.abc import Callable

import numpy as np
import torch

from meshot import Contour, empirical, quasi_directions, random_directions, sliced_wasserstein, surface
from meshot.mesh import regular_polygon, star

KINDS: dict[str, Callable] = {
    "continuous": lambda contour, n, generator: surface(contour),
    "continuous, weights fixed": lambda contour, n, generator: surface(contour, detach_weights=True),
    "samples, fixed draws": lambda contour, n, generator: empirical(contour, n, generator, detach_weights=True),
    "samples, carried": lambda contour, n, generator: empirical(contour, n, generator, detach_weights=False),
}


def descents(config: dict) -> list[dict]:
    """For every number of corners, kind of gradient and seed: the exact SW₂ to the star at the end."""
    settings = config["descent"]
    return [
        descend_once(n_corners, kind, seed, settings)
        for n_corners in settings["n_corners"]
        for kind in KINDS
        for seed in settings["seeds"]
    ]


def descend_once(n_corners: int, kind: str, seed: int, settings: dict) -> dict:
    """Adam with a cosine schedule. The target is the continuous star; directions and points are drawn at each step."""
    start, goal = regular_polygon(n_corners), star(**settings["star"])
    generator = np.random.default_rng([seed, 5])
    # To break the symmetry of the circle, the corners start slightly off it, in the same way for all kinds.
    off = 0.05 * torch.from_numpy(np.random.default_rng(seed).standard_normal(start.vertices.shape))
    vertices = (start.vertices + off).requires_grad_()
    optimiser = torch.optim.Adam([vertices], lr=settings["rate"])
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, settings["n_steps"])
    target = surface(goal)
    for _ in range(settings["n_steps"]):
        directions = random_directions(settings["n_directions"], 2, generator)
        measure = KINDS[kind](start.with_vertices(vertices), settings["n_points"], generator)
        optimiser.zero_grad()
        sliced_wasserstein(measure, target, directions).backward()
        optimiser.step()
        schedule.step()
    end = judged(start.with_vertices(vertices.detach()), goal)
    return {"n_corners": n_corners, "kind": kind, "seed": seed, "sliced_distance": end}


def judged(contour: Contour, goal: Contour) -> float:
    """The exact SW₂ along 360 equally spaced directions."""
    squared = sliced_wasserstein(surface(contour), surface(goal), quasi_directions(360, 2, seed=1))
    return float(squared) ** 0.5
