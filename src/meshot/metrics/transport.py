"""Transport distances between point sets of equal size, in NumPy and POT. They share no code with the losses."""

import math
import warnings

import numpy as np
import ot
import torch
from geomloss import SamplesLoss
from scipy.spatial.distance import cdist

from meshot.errors import require_positive_integer
from meshot.types import Array, Float


def earth_movers_distance(points: Float[Array, "n 3"], others: Float[Array, "n 3"]) -> float:
    """EMD: W₂, the root of the smallest mean squared distance over all pairings, exactly, in the units of the points.

    Raises
    ------
    ValueError
        If the numbers of points differ, or the solver does not converge.

    Notes
    -----
    POT's network simplex: about 1 s for 2 000 points, 8 s for 5 000, half a minute for 10 000; O(n²) memory.
    """
    _require_equal_counts(points, others)
    return exact_transport(points, others)


def exact_transport(points: Float[Array, "n d"], others: Float[Array, "m d"]) -> float:
    """W₂ between two point sets of equal masses, exactly, as a length in the units of the points.

    Raises
    ------
    ValueError
        If the solver does not converge.

    Notes
    -----
    The tolerance of the solver is absolute. The points are therefore first divided by their largest coordinate.
    """
    centre = points[0].copy()
    points, others = points - centre, others - centre
    unit = max(float(np.abs(points).max()), float(np.abs(others).max())) or 1.0
    cost = cdist(points / unit, others / unit, "sqeuclidean")  # from differences: no cancellation
    masses = [np.full(len(side), 1 / len(side)) for side in (points, others)]
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        squared = ot.emd2(*masses, cost, numItermax=max(10_000_000, 100 * cost.size))
    if caught:
        raise ValueError(f"the transport solver did not finish ({caught[0].message}): use fewer points")
    return unit * math.sqrt(max(0.0, float(squared)))


def sinkhorn_distance(points: Float[Array, "n 3"], others: Float[Array, "n 3"], blur: float) -> float:
    """EMD by regularised transport: the root of the debiased Sinkhorn divergence with squared distances as cost.

    It is computed by GeomLoss, whose value at p = 2 is half the squared cost and is doubled here. The temperature is
    annealed by a factor of 0.95² per step. The iteration stops before convergence, so the value is below W₂: by 3 % for
    two samples of one cortical surface, and by less if the surfaces differ.

    Parameters
    ----------
    points, others : array
        Equally many points, all of the same mass.
    blur : float
        The length scale of the regularisation, in units of the points: the root of the final temperature.

    Raises
    ------
    ValueError
        If the numbers of points differ, or the blur is not a positive number.

    Notes
    -----
    O(n²) time and memory. On a CPU the exact solver is faster at every size that fits into memory: 2 000 points take
    15 s here and 1 s there. This function is for comparison with published values, and for GPUs.

    References
    ----------
    Feydy et al., *Interpolating between optimal transport and MMD using Sinkhorn divergences*, AISTATS 2019.
    """
    _require_equal_counts(points, others)
    if not (math.isfinite(blur) and blur > 0):
        raise ValueError(f"blur is {blur!r}; a length > 0 is needed, in units of the points, such as 0.1 mm")
    loss = SamplesLoss("sinkhorn", p=2, blur=blur, scaling=0.95, debias=True, backend="tensorized")
    with torch.no_grad():
        half_squared = loss(torch.from_numpy(points), torch.from_numpy(others))
    return math.sqrt(max(0.0, 2 * float(half_squared)))


def sliced_distance(points: Float[Array, "n 3"], others: Float[Array, "n 3"], n_directions: int = 200) -> float:
    """SWD: SW₂, the root of the mean over directions of the squared W₂ of the projections, in the units of the points.

    The directions form a spiral on the half sphere, the same in every call.

    Raises
    ------
    ValueError
        If the numbers of points differ, or ``n_directions`` is not a positive integer.
    """
    _require_equal_counts(points, others)
    require_positive_integer(n_directions, "n_directions")
    total = 0.0
    for direction in half_sphere(n_directions):
        gap = np.sort(points @ direction) - np.sort(others @ direction)
        total += float(np.mean(gap * gap))
    return math.sqrt(total / n_directions)


def half_sphere(n: int) -> Float[Array, "n 3"]:
    """Evenly spread unit vectors on the upper half sphere: equal steps in height, rotated by the golden angle each."""
    height = (np.arange(n) + 0.5) / n
    angle = math.pi * (3 - math.sqrt(5)) * np.arange(n)
    radius = np.sqrt(1 - height**2)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)


def _require_equal_counts(points: Array, others: Array) -> None:
    if len(points) != len(others) or not len(points):
        raise ValueError(
            f"there are {len(points)} and {len(others)} points; equally many are needed, at least one: all carry "
            "the same mass"
        )
