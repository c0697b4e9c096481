"""Random and deterministic sets of directions (unit vectors) for slicing."""

import math

import numpy as np
import torch

from meshot.errors import as_floating, require_positive_integer, require_shape
from meshot.loss.quasi_sets import CONSTRUCTIONS, Construction, orthonormal_blocks, unit_rows
from meshot.rng import Generator, numpy_generator
from meshot.types import Array, Float, Tensor

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
        raise ValueError(f"method {method!r} is for R^{only} only, and d is {d}: take 'sobol', or None for the default")
    return construct


def require_directions(directions: Directions, like: Tensor) -> Tensor:
    """Directions as unit rows in the space of ``like``, with its dtype and device.

    Parameters
    ----------
    directions : tensor, array or int
        Unit rows; or their number, for the deterministic set :func:`meshot.quasi_directions` with seed 0.
    like : tensor
        Points of the space.

    Raises
    ------
    ValueError
        If the number is not a positive integer, the shape does not fit, or a row does not have unit length.
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
