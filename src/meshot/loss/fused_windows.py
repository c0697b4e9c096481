"""The windowed loss computed by the kernels: a window at a time, several windows on several threads."""

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple, TypeVar

import numpy as np
import torch
from torch.autograd.function import once_differentiable

from meshot.loss._kernel_windows import find_in_window
from meshot.loss.fused import fused_slices
from meshot.types import Array, Float, Tensor

#: Cut-off of a window, in units of its radius. The Gaussian has decreased to about 1/20 there.
REACH = 2.5
_AHEAD = 8  # windows per thread whose gradients are held before they are added
_ALONE = 1 << 16  # number of points, over all windows, below which a second thread does not pay off
Result = TypeVar("Result")


class _FusedWindows(torch.autograd.Function):
    """The mean over the windows, and how many were counted. The gradient is stored for the backward pass."""

    @staticmethod
    def forward(ctx, source, source_weights, target, target_weights, centres, radius, directions, p):
        tensors = (source, source_weights, target, target_weights)
        costs, gradients = fused_windows(tensors, centres, radius, directions, p, ctx.needs_input_grad[:4])
        ctx.gradients = [None if g is None else torch.from_numpy(g).to(source.dtype) for g in gradients]
        count = torch.tensor(len(costs))
        ctx.mark_non_differentiable(count)
        return source.new_tensor(costs.mean() if len(costs) else 0.0), count

    @staticmethod
    @once_differentiable
    def backward(ctx, grad_output, _):
        return *(None if g is None else grad_output * g for g in ctx.gradients), None, None, None, None


def mean_of_windows(
    measures: Sequence[Tensor],
    centres: Float[Tensor, "K k"],
    radius: float,
    directions: Float[Tensor, "K L d"],
    p: float,
) -> tuple[Float[Tensor, ""], int]:
    """The mean over the windows that hold mass of both measures, differentiable once, and their number.

    The arguments are those of :func:`meshot.loss.fused_windows.fused_windows`.
    """
    value, count = _FusedWindows.apply(*measures, centres, radius, directions, p)
    return value, int(count)


def fused_windows(
    measures: Sequence[Tensor],
    centres: Float[Tensor, "K k"],
    radius: float,
    directions: Float[Tensor, "K L d"],
    p: float,
    wanted: Sequence[bool],
) -> tuple[Float[Array, " n"], list[Array | None]]:
    """The cost in every window that holds mass of both measures, and the gradients of the mean of these costs.

    Parameters
    ----------
    measures : tensors
        Points and weights of the source, then of the target.
    centres, radius, directions, p
        As in :func:`meshot.windowed_sliced_wasserstein`; the directions as unit rows.
    wanted : four bools
        Which gradients to compute. The others are returned as None.

    Notes
    -----
    A window is computed by one thread, and the gradients of the windows are added in their order. The result is
    therefore the same bit for bit for any number of threads.
    """
    places = centres.detach().double().numpy()
    sides = [_side(*measures[k : k + 2], places.shape[1]) for k in (0, 2)]
    lines = directions.detach().double()
    totals = [np.zeros(t.shape) if want else None for t, want in zip(measures, wanted)]
    costs = []

    def work(k: int) -> _Found | None:
        return _in_window(sides, places[k], radius, lines[k], p, wanted)

    n_points = len(places) * sum(len(side.weights) for side in sides)
    n_threads = max(1, min(torch.get_num_threads(), len(places), n_points // _ALONE))
    for found in _in_order(work, len(places), n_threads):
        if found is not None:
            costs.append(found.cost)
            for total, chosen, gradient in zip(totals, found.chosen, found.gradients):
                if total is not None:
                    total[chosen] += gradient
    return np.array(costs), [None if total is None else total / max(1, len(costs)) for total in totals]


@dataclasses.dataclass(frozen=True, eq=False)
class _Side:
    rows: Float[Array, "n d"]
    columns: Float[Array, "k n"]
    weights: Float[Array, " n"]


class _Found(NamedTuple):
    cost: float
    chosen: list[Array]  # the points of the four gradients
    gradients: list[Array | None]


def _side(points: Tensor, weights: Tensor, k: int) -> _Side:
    rows, masses = (np.ascontiguousarray(t.detach().double().numpy()) for t in (points, weights))
    return _Side(rows, np.ascontiguousarray(rows[:, :k].T), masses)


def _in_window(
    sides: list[_Side],
    centre: Float[Array, " k"],
    radius: float,
    lines: Float[Tensor, "L d"],
    p: float,
    wanted: Sequence[bool],
) -> _Found | None:
    """The cost in one window and its gradients at the points there; None if a measure has no mass there."""
    chosen, factors, measures = [], [], []
    for side in sides:
        inside, values = np.empty(len(side.weights), np.int64), np.empty(len(side.weights))
        count = find_in_window(side.columns, centre, radius, REACH * radius, inside, values)
        masses = side.weights[inside[:count]] * values[:count]
        total = masses.sum()
        if not total > 0:
            return None
        chosen += [inside[:count].copy()] * 2
        factors.append(values[:count] / total)
        measures += [torch.from_numpy(side.rows[chosen[-1]]), torch.from_numpy(masses / total)]
    costs, gradients = fused_slices(measures, lines, float(p), wanted, n_threads=1)
    for k, (shares, factor) in zip((1, 3), zip(measures[1::2], factors)):
        if wanted[k]:  # the masses in the window are divided by their sum
            gradients[k] = factor * (gradients[k] - shares.numpy() @ gradients[k])
    return _Found(costs.mean(), chosen, gradients)


def _in_order(work: Callable[[int], Result], n_items: int, n_threads: int) -> Iterator[Result]:
    """The results of ``work(0)``, ``work(1)``, ... in order, computed by several threads."""
    if n_threads == 1:
        yield from map(work, range(n_items))
        return
    step = _AHEAD * n_threads
    with ThreadPoolExecutor(n_threads) as pool:
        for start in range(0, n_items, step):
            yield from pool.map(work, range(start, min(start + step, n_items)))
