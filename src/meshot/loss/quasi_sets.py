"""Quasi-random sets of directions: constructions on the unit sphere of R^d, before the random rotation."""

import functools
import math
from collections.abc import Callable

import numpy as np

from meshot.types import Array, Float


def unit_rows(vectors: Float[Array, "*batch d"]) -> Float[Array, "*batch d"]:
    """The rows divided by their Euclidean norms."""
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def equal_angles(n: int, d: int, seed: int) -> Float[Array, "n d"]:
    """In R²: equal angles on a half circle, since opposite directions have the same cost."""
    angles = math.pi * np.arange(n) / n
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)


def fibonacci_spiral(n: int, d: int, seed: int) -> Float[Array, "n d"]:
    """In R³: the Fibonacci spiral from pole to pole, with equal areas and the golden angle between neighbours."""
    return _spiral(1 - 2 * (np.arange(n) + 0.5) / n)


def half_fibonacci_spiral(n: int, d: int, seed: int) -> Float[Array, "n d"]:
    """In R³: the Fibonacci spiral on the upper half sphere, so that no two directions are nearly opposite."""
    return _spiral(1 - (np.arange(n) + 0.5) / n)


def _spiral(height: Array) -> Array:
    angle = math.pi * (1 + math.sqrt(5)) * (np.arange(len(height)) + 0.5)
    radius = np.sqrt(1 - height**2)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)


def kronecker_lattice(n: int, d: int, seed: int) -> Float[Array, "n d"]:
    """A shifted rank-1 lattice with d − 1 irrational steps, mapped to the half sphere by an area-preserving map.

    References
    ----------
    Roberts, *The Unreasonable Effectiveness of Quasirandom Sequences*, 2018 (steps: powers of the root of
    x^d = x + 1).
    """
    growth = 2.0
    for _ in range(64):
        growth = (1 + growth) ** (1 / d)
    steps = growth ** -np.arange(1.0, d)
    shift = np.random.default_rng([seed, 1]).random(d - 1)
    return _half_sphere((shift + np.arange(n)[:, None] * steps) % 1)


def _half_sphere(cube: Array) -> Array:
    """Unit rows in R^d from (n, d − 1) numbers in [0, 1): each coordinate by the inverse of its Beta distribution."""
    from scipy.special import betaincinv

    d = cube.shape[1] + 1
    columns, radius = [], np.ones(len(cube))
    for k in range(d - 2):
        shape = (d - k - 1) / 2
        height = 2 * betaincinv(shape, shape, cube[:, k]) - 1
        columns.append(radius * height)
        radius = radius * np.sqrt(np.maximum(1 - height**2, 0))
    angle = math.pi * cube[:, -1]
    return np.stack([*columns, radius * np.cos(angle), radius * np.sin(angle)], axis=1)


def sobol_points(n: int, d: int, seed: int) -> Float[Array, "n d"]:
    """A scrambled Sobol sequence mapped through the Gaussian quantile function and normalised."""
    return unit_rows(_sobol_gaussian(n, d, seed))


def sobol_frames(n: int, d: int, seed: int) -> Float[Array, "n d"]:
    """Orthonormal blocks made from a scrambled Sobol sequence with d² coordinates."""
    gaussian = _sobol_gaussian(math.ceil(n / d), d * d, seed)
    return orthonormal_blocks(gaussian.reshape(-1, d, d)).reshape(-1, d)[:n]


def _sobol_gaussian(n: int, d: int, seed: int) -> Array:
    from scipy.special import ndtri
    from scipy.stats.qmc import Sobol

    points = Sobol(d, scramble=True, rng=np.random.default_rng(seed)).random_base2(max(0, math.ceil(math.log2(n))))[:n]
    return ndtri(np.maximum(points, 1e-12))  # a point may be 0, but never 1


def orthonormal_blocks(gaussian: Float[Array, "k d d"]) -> Float[Array, "k d d"]:
    """Orthonormal rows from Gaussian ones, with signs chosen such that they are uniform on the orthogonal group.

    References
    ----------
    Mezzadri, *How to generate random matrices from the classical compact groups*, Notices of the AMS, 2007.
    """
    basis, triangular = np.linalg.qr(gaussian)
    signs = np.sign(np.diagonal(triangular, axis1=1, axis2=2))
    return np.swapaxes(basis * signs[:, None, :], 1, 2)


def repelling_lines(n: int, d: int, seed: int) -> Float[Array, "n d"]:
    """Lines through the origin that are a local minimum of the energy Σ 1/|θᵢ − θⱼ| + 1/|θᵢ + θⱼ|.

    Computed by at most 100 steps of L-BFGS from a Kronecker lattice, each with O(n²) time and memory.
    Results are cached.
    """
    return _repelled(n, d).copy()


@functools.lru_cache(maxsize=8)
def _repelled(n: int, d: int) -> Array:
    from scipy.optimize import minimize

    start = kronecker_lattice(n, d, 0)
    if n == 1:
        return start
    found = minimize(
        _energy, start.ravel(), args=(n, d), jac=True, method="L-BFGS-B", options={"maxiter": 100, "gtol": 1e-12}
    )
    return unit_rows(found.x.reshape(n, d))


def _energy(flat: Array, n: int, d: int) -> tuple[float, Array]:
    vectors = flat.reshape(n, d)
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    rows = vectors / lengths
    cosines = rows @ rows.T
    np.fill_diagonal(cosines, 0)
    near = [np.sqrt(np.maximum(2 - 2 * sign * cosines, 1e-12)) for sign in (1, -1)]
    repulsion = near[0] ** -3 - near[1] ** -3
    np.fill_diagonal(repulsion, 0)
    gradient = 2 * repulsion @ rows / n**2
    gradient -= (gradient * rows).sum(axis=1, keepdims=True) * rows
    return float((1 / near[0] + 1 / near[1]).sum() / n**2), (gradient / lengths).ravel()


Construction = Callable[[int, int, int], Array]

#: The constructions by name, each with the dimension that it is for (None: any above one).
CONSTRUCTIONS: dict[str, tuple[Construction, int | None]] = {
    "equal angles": (equal_angles, 2),
    "spiral": (fibonacci_spiral, 3),
    "half spiral": (half_fibonacci_spiral, 3),
    "lattice": (kronecker_lattice, None),
    "sobol": (sobol_points, None),
    "sobol frames": (sobol_frames, None),
    "repelling": (repelling_lines, None),
}
