"""Exact optimal transport between discrete measures, by the network simplex algorithm of POT."""

import math
import warnings

import ot
import torch

from meshot.measure import MeasureLike, as_point_measures
from meshot.types import Float, Tensor


def wasserstein(
    source: MeasureLike, target: MeasureLike, p: float = 2, max_iterations: int = 10_000_000
) -> Float[Tensor, ""]:
    r"""The Wasserstein distance W_p^p with ground cost ‖x − y‖₂^p, exactly, by linear programming.

    .. math::

        \min_{P \ge 0} \; \sum_{ij} P_{ij} \, \lVert x_i - y_j \rVert_2^p
        \quad \text{such that} \quad P 1 = a, \; P^\top 1 = b

    Here P is a plan between the masses a and b. The value is differentiable. For the points the optimal plan is treated
    as constant (envelope theorem). The gradient in the weights is given by the dual potentials, up to a constant. The
    paper writes ‖x − y‖_p^p; for p = 2 both costs are equal.

    Parameters
    ----------
    source, target : measure of points, Mesh, Contour, array or tensor
        Any numbers of support points, any weights. An (n, d) array or tensor means points of equal weight. A mesh means
        the barycentres of its faces, weighted by area (to draw points on it, use :func:`meshot.empirical`).
    p : float
        The exponent, at least 1.
    max_iterations : int
        Maximum number of iterations of the solver.

    Returns
    -------
    tensor
        W_p^p, in (units of the points)^p. The p-th root is a distance.

    Raises
    ------
    ValueError
        If an argument is not a measure of points, the measures are in different spaces, ``p`` is not a finite number
        >= 1, the solver does not converge, or the cost exceeds the range of the dtype.

    Notes
    -----
    About O(n³ log n) time and O(n²) memory: suitable for up to about 5 000 support points. The tolerance of the solver
    is absolute. The points are therefore scaled by a power of two to a size of about 1, and the value is scaled back.

    References
    ----------
    Bonneel et al., *Displacement Interpolation Using Lagrangian Mass Transport*, 2011 (the solver in POT).

    Examples
    --------
    >>> import numpy as np, meshot
    >>> float(meshot.wasserstein(np.array([[0.0, 0.0]]), np.array([[3.0, 4.0]])))
    25.0
    """
    source, target = as_point_measures(source, target)
    if not 1 <= p < math.inf:
        raise ValueError(f"p is {p!r}; a finite number >= 1 is needed")
    # From differences: |x|² + |y|² − 2⟨x, y⟩ would suffer from cancellation for close points.
    gaps = source.places[:, None, :] - target.places[None, :, :]
    unit = _power_of_two(float(gaps.detach().abs().max()))
    squared = (gaps / unit).square().sum(dim=2)
    cost = squared if p == 2 else torch.where(squared > 0, squared, torch.ones_like(squared)).pow(p / 2) * (squared > 0)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        # POT refuses arrays with gaps in memory.
        masses = source.weights.contiguous(), target.weights.contiguous()
        value = ot.emd2(*masses, cost.contiguous(), numItermax=max_iterations)
    if caught:
        raise ValueError(
            f"the transport solver did not finish ({caught[0].message}): raise max_iterations or use fewer points"
        )
    value = value * unit**p if p * math.log2(unit) < 1024 else value * math.inf
    if not math.isfinite(float(value.detach())):
        raise ValueError(
            f"W_p^p exceeds {value.dtype} at p = {p:g} for points {unit:.3g} apart: scale both measures down"
        )
    return value


def _power_of_two(size: float) -> float:
    return math.ldexp(1.0, math.frexp(size)[1] - 1) if 0 < size < math.inf else 1.0
