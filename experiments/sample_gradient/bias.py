"""Slopes of losses along one-parameter families of shapes: exact, by differences, and as means over draws."""

from collections.abc import Callable

import numpy as np
import torch

from meshot import (
    Contour,
    DiscreteMeasure,
    Mesh,
    SurfaceMeasure,
    empirical,
    random_directions,
    sliced_wasserstein,
    surface,
)
from meshot.mesh import icosphere
from meshot.types import Tensor

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
