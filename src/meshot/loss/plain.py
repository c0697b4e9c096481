"""The sliced loss in PyTorch operations: transport on many lines at once, on any device."""

import math
from typing import NamedTuple

import numpy as np
import torch

from meshot.loss.directions import Directions, require_directions
from meshot.measure import Measure, MeasureLike, as_point_measures
from meshot.threads import in_chunks
from meshot.types import Float, Int64, Tensor


def plain_sliced_wasserstein(
    source: MeasureLike, target: MeasureLike, directions: Directions = 100, p: float = 2
) -> Float[Tensor, ""]:
    """The value of :func:`meshot.sliced_wasserstein` between points, computed by PyTorch operations.

    It runs on any device and has derivatives of any order. The arguments are the same, but a mesh means the barycentres
    of its faces, weighted by area.

    Raises
    ------
    ValueError
        As :func:`meshot.sliced_wasserstein`, and for a continuous measure.

    Notes
    -----
    O(L (n log n + m log m)) time, O(L (n + m)) memory.
    """
    source, target = as_point_measures(source, target)
    return plain_costs(source, target, checked_lines(source, directions, p), p).mean()


def checked_lines(source: Measure, directions: Directions, p: float) -> Float[Tensor, "L d"]:
    """The directions as unit rows in the space of ``source``, after a check of the exponent.

    Raises
    ------
    ValueError
        If ``p`` is not a finite number >= 1, or the directions do not fit.
    """
    if not 1 <= p < math.inf:
        raise ValueError(f"p is {p!r}; a finite number >= 1 is needed (below one, sorting is not optimal)")
    return require_directions(directions, source.places)


def plain_costs(source: Measure, target: Measure, directions: Float[Tensor, "L d"], p: float) -> Float[Tensor, " L"]:
    """W_p^p between two measures of points along every direction, differentiable with respect to all arguments."""
    projected, projected_target = directions @ source.places.T, directions @ target.places.T
    if same_equal_masses(source.weights, target.weights):
        return paired_cost(projected, projected_target, p)
    return quantile_cost(projected, source.weights, projected_target, target.weights, p)


def same_equal_masses(weights: Tensor, others: Tensor) -> bool:
    """Whether all points of both measures have the same constant mass, so that transport pairs the sorted points."""
    if weights.shape != others.shape or weights.requires_grad or others.requires_grad:
        return False
    return bool((weights == weights[0]).all()) and bool((others == weights[0]).all())


def paired_cost(source: Float[Tensor, "L n"], target: Float[Tensor, "L n"], p: float = 2) -> Float[Tensor, " L"]:
    """W_p^p between equally many points of equal mass on a line, for every row: the mean over sorted pairs."""
    gap = source.gather(1, row_order(source)) - target.gather(1, row_order(target))
    return power(gap, p).mean(dim=1)


def row_order(values: Float[Tensor, "L n"], kind: str = "quicksort") -> Int64[Tensor, "L n"]:
    """The permutation that sorts every row."""
    # On a CPU, NumPy sorts several times faster than torch. A stable sort merges rows that consist of sorted runs.
    if values.device.type == "cpu" and values.dtype in (torch.float32, torch.float64):
        rows = values.detach().numpy()
        order = in_chunks(lambda i, j: np.argsort(rows[i:j], axis=1, kind=kind), len(rows))
        return torch.from_numpy(np.concatenate(order))
    return values.detach().argsort(dim=1, stable=kind == "stable")


def quantile_cost(
    source: Float[Tensor, "L n"],
    source_weights: Float[Tensor, " n"],
    target: Float[Tensor, "L m"],
    target_weights: Float[Tensor, " m"],
    p: float = 2,
) -> Float[Tensor, " L"]:
    r"""W_p^p between weighted points on a line, for every row.

    .. math::

        \W_p^p = \int_0^1 |F^{-1}(z) - G^{-1}(z)|^p \, dz

    F and G are the distribution functions of the two sets of points.
    """
    cells = quantile_cells(source, source_weights, target, target_weights)
    return (power(cells.gap, p) * cells.mass).sum(dim=1)


class QuantileCells(NamedTuple):
    """The cells of [0, 1] on which two quantile functions are constant, for every row.

    Quantile functions of discrete measures are step functions. Their jumps divide [0, 1] into cells.
    """

    source_order: Int64[Tensor, "L n"]
    target_order: Int64[Tensor, "L m"]
    order: Int64[Tensor, "L k"]  # of the ends of the steps of both sides, the source first
    source_step: Int64[Tensor, "L k"]  # which step of either side a cell lies in
    target_step: Int64[Tensor, "L k"]
    gap: Float[Tensor, "L k"]
    mass: Float[Tensor, "L k"]


def quantile_cells(source: Tensor, source_weights: Tensor, target: Tensor, target_weights: Tensor) -> QuantileCells:
    """The cells of the quantile functions of weighted points on a line, for every row."""
    source_order, target_order = row_order(source), row_order(target)
    source, target = source.gather(1, source_order), target.gather(1, target_order)
    source_mass = source_weights[source_order].cumsum(dim=1)  # (L, n): where each step of F⁻¹ ends
    target_mass = target_weights[target_order].cumsum(dim=1)
    ends = torch.cat([source_mass, target_mass], dim=1)
    order = row_order(ends, "stable")
    cell_ends = ends.gather(1, order)  # (L, n + m)
    # The number of steps of either side that end before a cell is the index of its step.
    of_source = (order < source.shape[1]).long()
    ended = of_source.cumsum(dim=1) - of_source
    source_step = ended.clamp(max=source.shape[1] - 1)
    target_step = (torch.arange(ends.shape[1], device=ends.device) - ended).clamp(max=target.shape[1] - 1)
    gap = source.gather(1, source_step) - target.gather(1, target_step)
    mass = torch.diff(cell_ends, dim=1, prepend=torch.zeros_like(cell_ends[:, :1]))
    return QuantileCells(source_order, target_order, order, source_step, target_step, gap, mass)


def power(gap: Tensor, p: float) -> Tensor:
    """|gap|^p. The square is computed without a root or logarithm, so that gradients are finite at zero."""
    if p == 2:
        return gap.square()
    return gap.abs() if p == 1 else gap.abs().pow(p)
