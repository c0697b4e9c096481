"""Gradients through samples: the bias for fixed draws, and its effect on a descent."""

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch

from meshot import (
    Contour,
    DiscreteMeasure,
    Mesh,
    SurfaceMeasure,
    empirical,
    quasi_directions,
    random_directions,
    sliced_wasserstein,
    surface,
)
from meshot.mesh import icosphere, regular_polygon, star
from meshot.types import Tensor

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment

Family = Callable[[Tensor], Contour | Mesh]


def bent_line(reach: Tensor) -> Contour:
    """An L: from (0, 1) down to the origin, then right to (reach, 0)."""
    fixed = torch.tensor([[0.0, 1], [0, 0]], dtype=torch.float64)
    end = torch.stack([reach, torch.zeros_like(reach)])
    return Contour(torch.cat([fixed, end[None]]), torch.tensor([[0, 1], [1, 2]]))


def bulging_sphere(size: Tensor) -> Mesh:
    """A sphere of 40 mm whose upper half is stretched upwards by the factor ``size``."""
    sphere = icosphere(2, 40.0)
    up = sphere.vertices[:, 2]
    stretched = torch.stack([*sphere.vertices[:, :2].T, torch.where(up > 0, size * up, up)], dim=1)
    return sphere.with_vertices(stretched)


def curve(config: dict) -> list[dict]:
    """The slope of the mean of x over an L, that is, W₁ to the origin along x: exactly 3/8; points alone give 1/4."""
    origin = DiscreteMeasure(torch.zeros(1, 2, dtype=torch.float64))
    along_x = torch.tensor([[1.0, 0.0]], dtype=torch.float64)
    return slopes("mean of x on an L", bent_line, origin, along_x, 1, config["curve"])


def losses(config: dict) -> list[dict]:
    """The slope of SW₂² to a continuous target, on an L and on a surface."""
    settings = config["losses"]
    longer = torch.tensor(1.6, dtype=torch.float64)
    cases = {
        "SW₂² of two Ls": (bent_line, surface(bent_line(longer)), 2),
        "SW₂² of two half-stretched spheres": (bulging_sphere, surface(bulging_sphere(longer)), 3),
    }
    rows = []
    for name, (family, target, d) in cases.items():
        rows += slopes(name, family, target, random_directions(settings["n_directions"], d, 0), 2, settings)
    return rows


def slopes(
    name: str, family: Family, target: SurfaceMeasure | DiscreteMeasure, directions: Tensor, p: int, settings: dict
) -> list[dict]:
    """For every number of points: means of sampled slopes with 95 % intervals, and the exact slopes."""

    def slope(encode: Callable) -> float:
        size = torch.tensor(1.0, dtype=torch.float64, requires_grad=True)
        return float(torch.autograd.grad(sliced_wasserstein(encode(family(size)), target, directions, p), size)[0])

    known = {
        "exact": slope(surface),
        "exact_fixed_weights": slope(lambda shape: surface(shape, detach_weights=True)),
        "by_differences": _by_differences(family, target, directions, p, settings["step"]),
    }
    rows = []
    for n_points in settings["sizes"]:
        row = {"case": name, "n_points": n_points, **known}
        for kind, detach in (("fixed_draws", True), ("carried", False)):
            generator = np.random.default_rng([0, n_points])
            drawn = [
                slope(lambda shape, g=generator, d=detach, n=n_points: empirical(shape, n, g, detach_weights=d))
                for _ in range(settings["n_draws"])
            ]
            half = 1.96 * float(np.std(drawn, ddof=1)) / len(drawn) ** 0.5
            mean = float(np.mean(drawn))
            row[kind] = {"mean": mean, "low": mean - half, "high": mean + half, "sd": float(np.std(drawn, ddof=1))}
        rows.append(row)
    return rows


def _by_differences(
    family: Family, target: SurfaceMeasure | DiscreteMeasure, directions: Tensor, p: int, step: float
) -> float:
    ends = [surface(family(torch.tensor(1 + sign * step, dtype=torch.float64))) for sign in (1, -1)]
    above, below = (float(sliced_wasserstein(end, target, directions, p)) for end in ends)
    return (above - below) / (2 * step)


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


PARTS = {"curve": curve, "losses": losses, "descent": descents}


def work(part: str, config: dict) -> object:
    """The results of a part."""
    return PARTS[part](config)


def summarise(rows: list[dict], config: dict) -> dict:
    """The results of all parts."""
    return {row["task"]: row["found"] for row in rows}


if __name__ == "__main__":
    experiment.run(__file__, lambda config: list(PARTS), work, summarise, "synthetic contours and surfaces")
