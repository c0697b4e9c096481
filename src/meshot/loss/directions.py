"""Unit vectors to project on."""

import math

import numpy as np
import torch

from meshot.errors import as_floating, require_positive_integer, require_shape
from meshot.rng import Generator, numpy_generator
from meshot.types import Float, Tensor


def random_directions(
    n: int, d: int, generator: Generator, dtype: torch.dtype = torch.float64, device: str | torch.device = "cpu"
) -> Float[Tensor, "n d"]:
    """Independent directions, uniform on the unit sphere of R^d: normalised Gaussian vectors.

    Parameters
    ----------
    n, d : int
        How many, and in what dimension.
    generator : numpy.random.Generator, torch.Generator or int
        Who holds the randomness; an integer is a seed.

    Raises
    ------
    ValueError
        If ``n`` or ``d`` is not a positive integer.
    """
    require_positive_integer(n, "n")
    require_positive_integer(d, "d")
    gaussian = numpy_generator(generator).standard_normal((n, d))
    return torch.from_numpy(_unit(gaussian)).to(device=device, dtype=dtype)


def quasi_directions(
    n: int, d: int, seed: int = 0, dtype: torch.dtype = torch.float64, device: str | torch.device = "cpu"
) -> Float[Tensor, "n d"]:
    """Directions spread more evenly than chance: equal angles, a Fibonacci spiral, or a scrambled Sobol sequence.

    In R² the angles are equal on the half circle; in R³ the points are a spherical Fibonacci spiral; elsewhere they
    are a scrambled Sobol sequence mapped through the Gaussian quantile function. Each set is turned by a random
    rotation drawn from ``seed``, so that the mean over seeds is unbiased.

    Parameters
    ----------
    n, d : int
        How many, and in what dimension.
    seed : int
        Of the rotation (and of the scrambling).

    Raises
    ------
    ValueError
        If ``n`` or ``d`` is not a positive integer.

    References
    ----------
    Nguyen, Bariletto and Ho, *Quasi-Monte Carlo for 3D Sliced Wasserstein*, ICLR 2024.
    """
    from scipy.stats import ortho_group

    require_positive_integer(n, "n")
    require_positive_integer(d, "d")
    if d == 1:
        return torch.ones(n, 1, dtype=dtype, device=device)
    constructed = {2: _equal_angles, 3: _fibonacci_spiral}.get(d, lambda count: _sobol_gaussian(count, d, seed))(n)
    rotation = ortho_group.rvs(d, random_state=np.random.default_rng(seed))
    return torch.from_numpy(_unit(constructed @ rotation.T)).to(device=device, dtype=dtype)


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def _equal_angles(n: int) -> np.ndarray:
    # θ and −θ project alike up to a reflection, so that half a circle is enough.
    angles = math.pi * np.arange(n) / n
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)


def _fibonacci_spiral(n: int) -> np.ndarray:
    index = np.arange(n) + 0.5
    height = 1 - 2 * index / n
    angle = math.pi * (1 + math.sqrt(5)) * index
    radius = np.sqrt(1 - height**2)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)


def _sobol_gaussian(n: int, d: int, seed: int) -> np.ndarray:
    from scipy.special import ndtri
    from scipy.stats.qmc import Sobol

    points = Sobol(d, scramble=True, rng=np.random.default_rng(seed)).random_base2(max(0, math.ceil(math.log2(n))))[:n]
    return ndtri(np.clip(points, 1e-12, 1 - 1e-12))


def require_directions(directions: Tensor, like: Tensor) -> Tensor:
    """Directions for the space of ``like``: unit rows of the same dimension, moved to its dtype and device.

    Raises
    ------
    ValueError
        If the shape does not fit, or a row is not of unit length.
    """
    directions = as_floating(directions, "directions")
    require_shape(directions, "directions", like.shape[-1])
    lengths = torch.linalg.vector_norm(directions.detach(), dim=1)
    if float((lengths - 1).abs().max()) > 1e-4:
        raise ValueError(
            f"directions has a row of length {float(lengths[(lengths - 1).abs().argmax()]):.6g}; unit rows are needed: "
            "divide each row by its norm, or use random_directions"
        )
    return directions.to(like)
