"""Optimal transport plans on a line, and the spread over lines of the cost of a translation."""

import dataclasses
import math

import torch

from meshot.errors import as_floating, require_positive_integer
from meshot.measure import as_probabilities
from meshot.types import Float, Int64, Tensor


@dataclasses.dataclass(frozen=True, eq=False)
class MonotonePlan:
    """The cells of [0, 1] on which both quantile functions are constant, in ascending order."""

    # source, target: for every cell, the index of the source point and of the target point
    source: Int64[Tensor, " k"]
    target: Int64[Tensor, " k"]
    # the lengths of the cells: the mass transported from that source point to that target point
    masses: Float[Tensor, " k"]


def monotone_plan(
    source: Float[Tensor, " n"],
    source_weights: Float[Tensor, " n"],
    target: Float[Tensor, " m"],
    target_weights: Float[Tensor, " m"],
) -> MonotonePlan:
    """The optimal plan between two discrete measures on a line, for all costs :math:`|x - y|^p` with p ≥ 1."""
    # Mass is transported from the smallest remaining source point to the smallest remaining target point, until one of
    # the two is exhausted. At most n + m − 1 cells have mass, and only these are returned. The masses are
    # differentiable with respect to the weights, if no weight is zero and no two steps end at the same value.
    sides = []
    for name, positions, weights in (("source", source, source_weights), ("target", target, target_weights)):
        positions = as_floating(positions, name)
        if positions.ndim != 1 or len(positions) == 0:
            raise ValueError(
                f"{name} has shape {tuple(positions.shape)}; (n,) is needed: places on a line, at least one"
            )
        weights = as_probabilities(weights, positions, len(positions))
        order = positions.detach().argsort(stable=True)
        ends = weights[order].cumsum(dim=0)
        # The last step of either side ends exactly at one, without roundoff.
        sides.append((order, ends / ends[-1]))
    (order, ends), (target_order, target_ends) = sides
    cuts, which = torch.cat([ends[:-1], target_ends[:-1], ends.new_ones(1)]).sort(stable=True)
    masses = torch.diff(cuts, prepend=cuts.new_zeros(1))
    of_source = torch.cat([which[:-1] < len(ends) - 1, which.new_zeros(1).bool()]).long()
    ended = of_source.cumsum(dim=0) - of_source
    step, target_step = ended, torch.arange(len(cuts), device=cuts.device) - ended
    kept = masses.detach() > 0
    return MonotonePlan(order[step[kept]], target_order[target_step[kept]], masses[kept])


def translation_spread(d: int, p: float = 2) -> float:
    r"""The relative standard deviation, over random directions, of the cost of a translation.

    Along θ a translation by t costs :math:`|\langle t, \theta \rangle|^p`. The ratio of the standard deviation of this
    cost to its mean depends only on d and p. For p = 2 it is :math:`\sqrt{2 (d - 1)/(d + 2)}`, below √2 in any
    dimension. Divided by √L it is the relative standard error of L random directions.

    Parameters
    ----------
    d : int
        The dimension of the space.
    p : float
        The exponent, at least 1.

    Raises
    ------
    ValueError
        If ``d`` is not a positive integer, or ``p`` is not a finite number >= 1.
    """
    require_positive_integer(d, "d")
    if not 1 <= p < math.inf:
        raise ValueError(f"p is {p!r}; a finite number >= 1 is needed")
    log_ratio = _log_moment(2 * p, d) - 2 * _log_moment(p, d)
    return math.sqrt(max(math.expm1(log_ratio), 0.0))


def _log_moment(q: float, d: int) -> float:
    """The logarithm of E|θ₁|^q for a uniform direction θ: Γ(d/2) Γ((q + 1)/2) / (Γ((d + q)/2) √π)."""
    return math.lgamma(d / 2) + math.lgamma((q + 1) / 2) - math.lgamma((d + q) / 2) - math.lgamma(0.5)


def directions_for_translation(relative_error: float, d: int, p: float = 2) -> int:
    """The number of random directions for a relative standard error of ``relative_error``, for a translation."""
    # This is a first choice of L that needs no computation of a loss. For a given pair of measures use
    # :meth:`meshot.SlicedEstimate.directions_needed`. In R³ with p = 2, 1 % requires 8000 directions and 10 % requires
    # 80.
    if not relative_error > 0:
        raise ValueError(f"relative_error is {relative_error!r}; a share above 0 is needed, such as 0.01 for 1 %")
    return max(1, math.ceil(round((translation_spread(d, p) / relative_error) ** 2, 9)))
