"""The kernel norm computed by the kernels: order of the points, division into threads, gradients."""

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
import torch
from scipy.spatial import cKDTree
from torch.autograd.function import once_differentiable

from meshot.loss._kernel_pairs import BLOCK, sum_kernel
from meshot.threads import in_chunks
from meshot.types import Array, Float, Tensor

_PIECE = 256  # number of points whose sums one thread computes at a time


class _FusedNorm(torch.autograd.Function):
    """The squared kernel norm of a difference. Its gradient is computed with the value, for the backward pass."""

    @staticmethod
    def forward(ctx, x, m, a, y, n, b, angular):
        reach = math.sqrt(-math.log(torch.finfo(x.dtype).eps))  # a kernel farther apart is below the rounding error
        sides, wanted = (_side(x, m, a), _side(y, n, b)), ctx.needs_input_grad
        own = [_own(side, angular, reach, any(wanted[k : k + 3])) for side, k in zip(sides, (0, 3))]
        cross = [_sums(*sides, angular, reach, any(wanted[:3])), None]
        if any(wanted[3:6]):
            cross[1] = _sums(*sides[::-1], angular, reach, True)
        ctx.gradients = []
        for side, mine, other, k in zip(sides, own, cross, (0, 3)):
            found = _gradients(side, mine, other) if any(wanted[k : k + 3]) else (None, None, None)
            ctx.gradients += [None if g is None else torch.from_numpy(g).to(x.dtype) for g in found]
        values = [side.masses @ each.values for side, each in zip((*sides, sides[0]), (*own, cross[0]))]
        return x.new_tensor(values[0] + values[1] - 2 * values[2])

    @staticmethod
    @once_differentiable
    def backward(ctx, grad_output):
        return *(None if g is None else grad_output * g for g in ctx.gradients), None


def fused_norm(
    first: Sequence[Tensor], second: Sequence[Tensor], angular: tuple[float, float, float, float]
) -> Float[Tensor, ""]:
    """The squared kernel norm of the difference of two varifolds, differentiable once.

    Parameters
    ----------
    first, second : three tensors
        Positions in widths of the kernel, unit normals, and masses.
    angular : four floats
        The kernel of two normals, see :mod:`meshot.loss._kernel_pairs`.
    """
    return _FusedNorm.apply(*first, *second, angular)


@dataclasses.dataclass(frozen=True, eq=False)
class _Side:
    """One measure in the format of the kernels: neighbours in space are neighbours in memory."""

    rows: Float[Array, "6 n"]
    masses: Float[Array, " n"]
    order: Array
    low: Float[Array, "3 blocks"]
    high: Float[Array, "3 blocks"]


@dataclasses.dataclass(frozen=True, eq=False)
class _Sums:
    """For every point of a side, the sum of the kernel over the points of a side, and its gradient if needed."""

    values: Float[Array, " n"]
    gradients: Float[Array, "6 n"] | None


def _side(positions: Tensor, normals: Tensor, masses: Tensor) -> _Side:
    columns, weights = (t.detach().double().numpy() for t in (torch.cat([positions, normals], dim=1), masses))
    order = cKDTree(columns[:, :3]).indices  # leaf by leaf
    rows, starts = np.ascontiguousarray(columns[order].T), np.arange(0, len(order), BLOCK)
    low, high = (extreme.reduceat(rows[:3], starts, axis=1) for extreme in (np.minimum, np.maximum))
    return _Side(rows, np.ascontiguousarray(weights[order]), order, low, high)


def _sums(side: _Side, other: _Side, angular: tuple, reach: float, gradient: bool, above: bool = False) -> _Sums:
    """The sums over the other side. Pieces of fixed size make them the same for any number of threads."""
    n = len(side.masses)
    values, gradients = np.zeros(n), np.zeros((6, n) if gradient else (0, 0))

    def work(first: int, last: int) -> None:
        for start in range(first * _PIECE, min(last * _PIECE, n), _PIECE):
            bounds = side.rows, start, min(start + _PIECE, n)
            onto = other.rows, other.masses, other.low, other.high
            sum_kernel(*bounds, *onto, reach, angular, above, values, gradients)

    in_chunks(work, -(-n // _PIECE))
    return _Sums(values, gradients if gradient else None)


def _own(side: _Side, angular: tuple, reach: float, gradient: bool) -> _Sums:
    """The sums over the side itself. Without a gradient, each pair is computed once and counted twice."""
    if gradient:
        return _sums(side, side, angular, reach, True)
    after = _sums(side, side, angular, reach, False, above=True)
    return _Sums(2 * after.values + sum(angular[1:]) * side.masses, None)  # the kernel of a point with itself


def _gradients(side: _Side, own: _Sums, cross: _Sums) -> tuple[Array, Array, Array]:
    """In positions, normals and masses, in the original order of the points."""
    rows, masses = np.empty_like(own.gradients.T), np.empty_like(side.masses)
    rows[side.order] = (2 * side.masses * (own.gradients - cross.gradients)).T
    masses[side.order] = 2 * (own.values - cross.values)
    return rows[:, :3], rows[:, 3:], masses
