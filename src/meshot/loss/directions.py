"""Unit vectors to project on."""

import math

import numpy as np
import torch

from meshot.errors import as_floating, require_positive_integer, require_shape
from meshot.loss.quasi_sets import CONSTRUCTIONS, Construction, orthonormal_blocks, unit_rows
from meshot.rng import Generator, numpy_generator
from meshot.types import Array, Float, Tensor

#: Unit rows, or how many of them: what a sliced loss takes.
Directions = Float[Tensor, "..."] | Float[Array, "..."] | int | np.integer
#: The construction that ``quasi_directions`` takes where none is named; elsewhere, the Sobol sequence.
DEFAULTS = {2: "equal angles", 3: "spiral"}


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
    """Directions in blocks of d at right angles: each one uniform on the sphere, the blocks independent.

    A block of d orthonormal rows is uniform on the orthogonal group. Within whole blocks the mean of θθᵀ is I/d
    exactly; then a translation by t costs ``|t|²/d`` for p = 2, without error, and SW₂ ≤ W₂/√d. Where ``n`` is no
    multiple of ``d`` the last block is cut.

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
    """Directions spread more evenly than chance.

    Each set is turned by a random rotation drawn from ``seed``, so that every row is uniform on the sphere and the mean
    of the loss over seeds is unbiased.

    Parameters
    ----------
    n, d : int
        How many, and in what dimension.
    seed : int
        Of the rotation (and of the scrambling or shift, where there is one).
    method : str, optional
        ``"equal angles"`` (R² only), ``"spiral"`` and ``"half spiral"`` (R³ only, Fibonacci), ``"lattice"``
        (Kronecker), ``"sobol"`` (scrambled, through the Gaussian quantile function), ``"sobol frames"`` (the same in
        orthonormal blocks), ``"repelling"`` (lines of least energy, O(n²)). None takes equal angles in R², the spiral
        in R³, and the Sobol sequence elsewhere.

    Raises
    ------
    ValueError
        If ``n`` or ``d`` is not a positive integer, or the method is not known or not for this dimension.

    Notes
    -----
    The defaults were chosen by ``experiments/directions``: of the sets that a formula gives, cheap and the same on any
    machine, they err least at a hundred directions, and at a thousand. Repelling lines err less in R³ and above, some
    two times less in R⁶; making a hundred takes milliseconds, a thousand seconds, once.

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
    construct = _construction(method, d)
    if d == 1:
        return torch.ones(n, 1, dtype=dtype, device=device)
    rotation = ortho_group.rvs(d, random_state=np.random.default_rng(seed))
    rows = unit_rows(construct(n, d, seed) @ rotation.T)
    return torch.from_numpy(rows).to(device=device, dtype=dtype)


def _construction(method: str | None, d: int) -> Construction:
    if method is None:
        method = DEFAULTS.get(d, "sobol")
    if method not in CONSTRUCTIONS:
        raise ValueError(f"method is {method!r}; one of {', '.join(map(repr, CONSTRUCTIONS))} is needed, or None")
    construct, only = CONSTRUCTIONS[method]
    if only not in (None, d):
        raise ValueError(f"method {method!r} lives in R^{only}, and d is {d}: take 'sobol', or None for the default")
    return construct


def require_directions(directions: Directions, like: Tensor) -> Tensor:
    """Directions for the space of ``like``: unit rows of the same dimension, moved to its dtype and device.

    Parameters
    ----------
    directions : tensor, array or int
        Unit rows; or a number of them, which are then even ones, always the same: :func:`meshot.quasi_directions`.
    like : tensor
        Points of the space.

    Raises
    ------
    ValueError
        If a number is no positive integer, the shape does not fit, or a row is not of unit length.
    """
    if isinstance(directions, int | np.integer):
        n = require_positive_integer(directions, "directions")
        return quasi_directions(n, like.shape[-1], dtype=like.dtype, device=like.device)
    directions = as_floating(directions, "directions")
    require_shape(directions, "directions", like.shape[-1])
    lengths = torch.linalg.vector_norm(directions.detach(), dim=1)
    if float((lengths - 1).abs().max()) > 1e-4:
        raise ValueError(
            f"directions has a row of length {float(lengths[(lengths - 1).abs().argmax()]):.6g}; unit rows are needed: "
            "divide each row by its norm, or use random_directions"
        )
    return directions.to(like)
