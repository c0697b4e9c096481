"""Random and deterministic sets of directions (unit vectors) for slicing."""

import functools
import math
from collections.abc import Callable

import numpy as np
import torch

from meshot.errors import as_points, require_positive_integer
from meshot.rng import Generator, numpy_generator
from meshot.types import Array, Float, Tensor

# Quasi-random sets of directions: constructions on the unit sphere of R^d, before the random rotation.


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
    """A shifted rank-1 lattice with d − 1 irrational steps, mapped to the half sphere by an area-preserving map."""
    from scipy.special import betaincinv

    growth = 2.0
    for _ in range(64):
        growth = (1 + growth) ** (1 / d)
    steps = growth ** -np.arange(1.0, d)
    shift = np.random.default_rng([seed, 1]).random(d - 1)
    cube = (shift + np.arange(n)[:, None] * steps) % 1  # (n, d − 1)
    # Each coordinate on the sphere by the inverse of its Beta distribution.
    columns, radius = [], np.ones(n)
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
    """Orthonormal rows from Gaussian ones, with signs chosen such that they are uniform on the orthogonal group."""
    basis, triangular = np.linalg.qr(gaussian)
    signs = np.sign(np.diagonal(triangular, axis1=1, axis2=2))
    return np.swapaxes(basis * signs[:, None, :], 1, 2)


def repelling_lines(n: int, d: int, seed: int) -> Float[Array, "n d"]:
    """Lines through the origin that are a local minimum of the energy Σ 1/|θᵢ − θⱼ| + 1/|θᵢ + θⱼ|."""
    # Computed by at most 100 steps of L-BFGS from a Kronecker lattice, each with O(n²) time and memory. Results are
    # cached.
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

#: Directions as accepted by a sliced loss: unit rows, or their number.
Directions = Float[Tensor, "..."] | Float[Array, "..."] | int | np.integer
#: The default construction of ``quasi_directions`` by dimension. In other dimensions it is the Sobol sequence.
DEFAULTS = {2: "equal angles", 3: "spiral"}


def random_directions(
    n: int, d: int, generator: Generator, dtype: torch.dtype = torch.float64, device: str | torch.device = "cpu"
) -> Float[Tensor, "n d"]:
    """Independent directions, uniform on the unit sphere of R^d: normalised Gaussian vectors.

    Parameters
    ----------
    n, d : int
        Number of directions, and dimension.
    generator : numpy.random.Generator, torch.Generator or int
        Random number generator; an integer is a seed.
    dtype, device : torch.dtype, torch.device
        Of the result.

    Raises
    ------
    ValueError
        If ``n`` or ``d`` is not a positive integer.

    Examples
    --------
    >>> import meshot
    >>> meshot.random_directions(5, 3, generator=0).norm(dim=1).round(decimals=9).tolist()
    [1.0, 1.0, 1.0, 1.0, 1.0]
    """
    require_positive_integer(n, "n")
    require_positive_integer(d, "d")
    gaussian = numpy_generator(generator).standard_normal((n, d))
    return torch.from_numpy(unit_rows(gaussian)).to(device=device, dtype=dtype)


def orthogonal_directions(
    n: int, d: int, generator: Generator, dtype: torch.dtype = torch.float64, device: str | torch.device = "cpu"
) -> Float[Tensor, "n d"]:
    """Directions in independent blocks of d orthogonal vectors. Each one is uniform on the sphere.

    A block of d orthonormal rows is uniform on the orthogonal group. Over whole blocks, the mean of θθᵀ is exactly I/d.
    The cost of a translation by t is then exactly :math:`|t|^2/d` for p = 2, and SW₂ ≤ W₂/√d. If ``n`` is no multiple
    of ``d``, the last block is incomplete.

    Parameters
    ----------
    n, d : int
        Number of directions, and dimension.
    generator : numpy.random.Generator, torch.Generator or int
        Random number generator; an integer is a seed.
    dtype, device : torch.dtype, torch.device
        Of the result.

    Raises
    ------
    ValueError
        If ``n`` or ``d`` is not a positive integer.

    References
    ----------
    Rowland et al., *Orthogonal Estimation of Wasserstein Distances*, AISTATS 2019.

    Examples
    --------
    >>> import torch, meshot
    >>> block = meshot.orthogonal_directions(3, 3, generator=0)
    >>> torch.allclose(block @ block.T, torch.eye(3, dtype=torch.float64))
    True
    """
    require_positive_integer(n, "n")
    require_positive_integer(d, "d")
    gaussian = numpy_generator(generator).standard_normal((math.ceil(n / d), d, d))
    rows = orthonormal_blocks(gaussian).reshape(-1, d)[:n]
    return torch.from_numpy(rows.copy()).to(device=device, dtype=dtype)


def quasi_directions(
    n: int,
    d: int,
    seed: int = 0,
    dtype: torch.dtype = torch.float64,
    device: str | torch.device = "cpu",
    method: str | None = None,
) -> Float[Tensor, "n d"]:
    """Quasi-random directions, which are spread more evenly than independent ones.

    Each set is rotated by a random rotation drawn from ``seed``. Every row is therefore uniform on the sphere, and the
    loss is unbiased over seeds.

    Parameters
    ----------
    n, d : int
        Number of directions, and dimension.
    seed : int
        Seed of the rotation (and of the scrambling or shift, if any).
    dtype, device : torch.dtype, torch.device
        Of the result.
    method : str, optional
        ``"equal angles"`` (R² only), ``"spiral"`` and ``"half spiral"`` (R³ only, Fibonacci), ``"lattice"``
        (Kronecker), ``"sobol"`` (scrambled, through the Gaussian quantile function), ``"sobol frames"`` (the same in
        orthonormal blocks), ``"repelling"`` (lines of minimal energy, O(n²)). The default is equal angles in R², the
        spiral in R³, and the Sobol sequence elsewhere.

    Raises
    ------
    ValueError
        If ``n`` or ``d`` is not a positive integer, or the method is not known or not for this dimension.

    Notes
    -----
    The defaults were chosen by ``experiments/directions``: they have the smallest error at 100 and at 1000 directions
    among the sets given by a formula, which are fast and the same on every machine. Repelling lines have a smaller
    error in R³ and above, by a factor of about two in R⁶. Computing 100 of them takes milliseconds, 1000 take seconds.

    References
    ----------
    Nguyen, Bariletto and Ho, *Quasi-Monte Carlo for 3D Sliced Wasserstein*, ICLR 2024.

    Examples
    --------
    >>> import meshot
    >>> meshot.quasi_directions(100, 3).shape
    torch.Size([100, 3])
    """
    from scipy.stats import ortho_group

    require_positive_integer(n, "n")
    require_positive_integer(d, "d")
    method = DEFAULTS.get(d, "sobol") if method is None else method
    if method not in CONSTRUCTIONS:
        raise ValueError(f"method is {method!r}; one of {', '.join(map(repr, CONSTRUCTIONS))} is needed, or None")
    construct, only = CONSTRUCTIONS[method]
    if only not in (None, d):
        raise ValueError(f"method {method!r} is for R^{only} only, and d is {d}: take 'sobol', or None for the default")
    if d == 1:
        return torch.ones(n, 1, dtype=dtype, device=device)
    rotation = ortho_group.rvs(d, random_state=np.random.default_rng(seed))
    rows = unit_rows(construct(n, d, seed) @ rotation.T)
    return torch.from_numpy(rows).to(device=device, dtype=dtype)


def require_directions(directions: Directions, like: Tensor, seed: Generator = 0) -> Tensor:
    """Directions as unit rows in the space of ``like``, with its dtype and device. The seed is that of a number."""
    if isinstance(directions, int | np.integer):
        n = require_positive_integer(directions, "directions")
        return quasi_directions(n, like.shape[-1], drawn_seed(seed), like.dtype, like.device)
    if not isinstance(seed, int) or seed != 0:
        raise ValueError(
            f"seed is {seed!r} beside directions of shape {tuple(np.shape(directions))}; a seed needs their number: "
            "pass, say, directions=100, or leave the seed out"
        )
    directions = as_points(directions, "directions", like.shape[-1])
    lengths = torch.linalg.vector_norm(directions.detach(), dim=1)
    if float((lengths - 1).abs().max()) > 1e-4:
        raise ValueError(
            f"directions has a row of length {float(lengths[(lengths - 1).abs().argmax()]):.6g}; unit rows are needed: "
            "divide each row by its norm, or use random_directions"
        )
    return directions.to(like)


def drawn_seed(seed: Generator) -> int:
    """A seed as an integer; of a generator, the next one that it draws."""
    if isinstance(seed, int | np.integer) and not isinstance(seed, bool) and seed >= 0:
        return int(seed)
    return int(numpy_generator(seed).integers(2**31))
