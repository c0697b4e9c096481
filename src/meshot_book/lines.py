"""Optimal transport plans on a line."""

import dataclasses

import torch

from meshot.errors import as_floating
from meshot.measure import as_probabilities
from meshot.types import Float, Int64, Tensor


@dataclasses.dataclass(frozen=True, eq=False)
class MonotonePlan:
    """The cells of [0, 1] on which both quantile functions are constant, in ascending order.

    Parameters
    ----------
    source, target : tensor
        For every cell, the index of the source point and of the target point.
    masses : tensor
        The lengths of the cells: the mass transported from that source point to that target point.
    """

    source: Int64[Tensor, " k"]
    target: Int64[Tensor, " k"]
    masses: Float[Tensor, " k"]


def monotone_plan(
    source: Float[Tensor, " n"],
    source_weights: Float[Tensor, " n"],
    target: Float[Tensor, " m"],
    target_weights: Float[Tensor, " m"],
) -> MonotonePlan:
    """The optimal plan between two discrete measures on a line, for all costs :math:`|x - y|^p` with p ≥ 1.

    Mass is transported from the smallest remaining source point to the smallest remaining target point, until one of
    the two is exhausted. At most n + m − 1 cells have mass, and only these are returned. The masses are differentiable
    with respect to the weights, if no weight is zero and no two steps end at the same value.
    """
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
