"""Pairs of measures that come with the exact value of a loss."""

import dataclasses
import math

import numpy as np
import torch

from meshot import DiscreteMeasure


@dataclasses.dataclass(frozen=True, eq=False)
class Problem:
    """Two measures, an exponent, and what SW_p^p and W_p^p are over all directions (None where not known)."""

    name: str
    source: DiscreteMeasure
    target: DiscreteMeasure
    p: float
    sliced: float | None
    wasserstein: float | None


def cloud(seed: int, n: int, d: int, weighted: bool = False, dtype: torch.dtype = torch.float64) -> DiscreteMeasure:
    """A random cloud, with random weights on request."""
    generator = np.random.default_rng(seed)
    weights = generator.random(n) + 0.1 if weighted else np.ones(n)
    points = torch.from_numpy(generator.standard_normal((n, d))).to(dtype)
    return DiscreteMeasure(points, torch.from_numpy(weights / weights.sum()).to(dtype))


def translation(seed: int, n: int, d: int) -> Problem:
    """A cloud and its translate by t: W₂² = |t|², and every projection moves by ⟨t, θ⟩, so that SW₂² = |t|²/d."""
    source = cloud(seed, n, d, weighted=True)
    shift = torch.from_numpy(np.random.default_rng(seed + 1).standard_normal(d))
    squared = float(shift.square().sum())
    target = DiscreteMeasure(source.points + shift, source.weights)
    return Problem(f"translation in R^{d}", source, target, 2, squared / d, squared)


def dilation(seed: int, n: int, d: int, factor: float) -> Problem:
    """A cloud x and s·x, s > 0: transport is monotone along every line; W₂² = (s − 1)² Σ aᵢ|xᵢ|², SW₂² a d-th of it."""
    source = cloud(seed, n, d, weighted=True)
    second = float((source.weights * source.points.square().sum(dim=1)).sum())
    target = DiscreteMeasure(factor * source.points, source.weights)
    return Problem(f"dilation in R^{d}", source, target, 2, (factor - 1) ** 2 * second / d, (factor - 1) ** 2 * second)


def two_diracs(d: int, p: float, distance: float = 1.7) -> Problem:
    """Two single points at distance r: W_p^p = r^p, SW_p^p = r^p E|θ₁|^p with the moment of a uniform direction."""
    origin, other = torch.zeros(1, d, dtype=torch.float64), torch.zeros(1, d, dtype=torch.float64)
    other[0, 0] = distance
    moment = math.gamma(d / 2) * math.gamma((p + 1) / 2) / (math.gamma((d + p) / 2) * math.sqrt(math.pi))
    return Problem(
        f"Diracs in R^{d}, p = {p}",
        DiscreteMeasure(origin),
        DiscreteMeasure(other),
        p,
        distance**p * moment,
        distance**p,
    )
