"""The sliced loss computed by the kernels: division into threads, memory layout, order of the points."""

import contextlib
import dataclasses
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import torch
from torch.autograd.function import once_differentiable

from meshot.loss._kernel_sliced import spread, walk_lines
from meshot.loss._kernel_sort import SMALL, sort_scratch
from meshot.types import Array, Float, Tensor

_GROUP = 1 << 19  # number of floats in the gradient rows that a thread fills before they are summed
_ALONE = 1 << 16  # number of projected points below which a second thread does not pay off


class _FusedSlices(torch.autograd.Function):
    """The mean cost along the directions. Its gradient is computed with the value and stored for the backward pass."""

    @staticmethod
    def forward(ctx, source, source_weights, target, target_weights, directions, p, walk):
        tensors = (source, source_weights, target, target_weights)
        costs, gradients = fused_slices(tensors, directions, p, ctx.needs_input_grad[:4], walk=walk)
        ctx.gradients = [None if g is None else torch.from_numpy(g).to(source) for g in gradients]
        return source.new_tensor(costs.mean())

    @staticmethod
    @once_differentiable
    def backward(ctx, grad_output):
        return *(None if g is None else grad_output * g for g in ctx.gradients), None, None, None


def mean_of_slices(
    measures: Sequence[Tensor], directions: Float[Tensor, "L d"], p: float, walk: Callable = walk_lines
) -> Float[Tensor, ""]:
    """The mean of the costs along the directions, differentiable in points and weights once.

    The arguments are those of :func:`meshot.loss.fused.fused_slices`.
    """
    return _FusedSlices.apply(*measures, directions, p, walk)


def takes_kernel(points: Tensor) -> bool:
    """Whether the kernels can compute a loss of these points: in float32 or float64 on the CPU."""
    return points.device.type == "cpu" and points.dtype in (torch.float32, torch.float64)


def fused_slices(
    measures: Sequence[Tensor],
    directions: Float[Tensor, "L d"],
    p: float,
    wanted: Sequence[bool],
    n_threads: int | None = None,
    walk: Callable = walk_lines,
) -> tuple[Float[Array, " L"], list[Array | None]]:
    """The transport cost along every direction, and the gradients of the mean cost.

    Parameters
    ----------
    measures : tensors
        Points and weights of the source, then of the target.
    directions : tensor
        Unit rows.
    p : float
        The exponent, at least 1; or what ``walk`` takes in its place.
    wanted : four bools
        Which gradients to compute. The others are returned as None.
    n_threads : int, optional
        By default up to ``torch.get_num_threads()``, fewer for small measures.
    walk : callable
        The kernel that computes the cost and the gradients along some directions.

    Notes
    -----
    Every thread processes some directions and writes the gradients in the points to rows, one per direction. Then every
    thread sums all rows for some of the points, in the order of the directions. The gradient is therefore the same bit
    for bit for any number of threads.
    """
    lines = _array(directions)
    sides = [_side(*measures[k : k + 2], *wanted[k : k + 2]) for k in (0, 2)]
    size = max(side.n for side in sides)
    n_threads = n_threads or max(1, min(torch.get_num_threads(), len(lines), len(lines) * size // _ALONE))
    per_thread = -(-len(lines) // n_threads)
    n_rounds = -(-per_thread // max(1, _GROUP // size))
    group = -(-per_thread // n_rounds)
    costs, tops = np.empty(len(lines)), np.zeros((len(lines), 2))
    _run(walk, sides, lines, p, costs, tops, n_threads, group)
    gradients = []
    for side, top in zip(sides, tops.sum(axis=0)):
        gradients += _finished(side, top, len(lines))
    return costs, gradients


@dataclasses.dataclass(frozen=True, eq=False)
class _Side:
    """One measure in the format of the kernels, and buffers of its gradients, empty if not needed."""

    columns: Float[Array, "d n"]
    weights: Float[Array, " n"]
    places: Array | None
    to_columns: Array
    to_weights: Array

    @property
    def n(self) -> int:
        return len(self.weights)

    @property
    def wanted(self) -> bool:
        return self.to_columns.size > 0 or self.to_weights.size > 0


def _side(points: Tensor, weights: Tensor, wants_points: bool, wants_weights: bool) -> _Side:
    rows, masses, places = _array(points), _array(weights), None
    if len(rows) > SMALL:
        # Points that are close in space have close projections. Storing them together improves cache use.
        places = _along_a_curve(rows)
        columns, masses = np.empty(rows.shape[::-1]), masses[places]
        for column, values in zip(columns, rows.T):
            np.take(values, places, out=column)
    else:
        columns = np.ascontiguousarray(rows.T)
    to_columns = np.zeros(columns.shape if wants_points else (0, 0))
    return _Side(columns, masses, places, to_columns, np.zeros(len(masses) if wants_weights else 0))


def _array(values: Tensor) -> Array:
    return np.ascontiguousarray(values.detach().double().cpu().numpy())


def _along_a_curve(rows: Float[Array, "n d"]) -> Array:
    """The order of the points along a Morton curve in the three coordinates of largest extent."""
    spread_of = rows.max(axis=0) - rows.min(axis=0)
    code = np.zeros(len(rows), np.int64)
    for axis, k in enumerate(np.argsort(-spread_of)[:3]):
        scale = 1023 / spread_of[k] if 0 < spread_of[k] < np.inf else 0.0
        cells = ((rows[:, k] - rows[:, k].min()) * scale).astype(np.int64)
        # Insert two zero bits between neighbouring bits of a ten-bit number.
        for shift, mask in ((16, 0x30000FF), (8, 0x300F00F), (4, 0x30C30C3), (2, 0x9249249)):
            cells = (cells | cells << shift) & mask
        code |= cells << axis
    return np.argsort(code).astype(np.int32)


def _run(
    kernel: Callable,
    sides: list[_Side],
    lines: Float[Array, "L d"],
    p: float,
    costs: Float[Array, " L"],
    tops: Float[Array, "L 2"],
    n_threads: int,
    group: int,
) -> None:
    """Process all directions in rounds of ``n_threads`` times ``group``: costs and gradient rows, then the sums."""
    rows = [_rows(side, n_threads * group) for side in sides]
    rooms = [_room(sides, group) for _ in range(n_threads)]
    with _threads(n_threads) as each:
        for start in range(0, len(lines), n_threads * group):
            block = slice(start, start + n_threads * group)
            n_lines = len(lines[block])

            def walk(k: int, block: slice = block, n_lines: int = n_lines) -> None:
                own = slice(n_lines * k // n_threads, n_lines * (k + 1) // n_threads)
                laid = [_laid(*parts, own) for parts in zip(sides, rooms[k], rows)]
                kernel(lines[block][own], p, *laid, costs[block][own], tops[block][own])

            def add(k: int, block: slice = block) -> None:
                for side, (gradients, drops) in zip(sides, rows):
                    if side.wanted:
                        bounds = side.n * k // n_threads, side.n * (k + 1) // n_threads
                        spread(gradients, drops, lines[block], *bounds, side.to_columns, side.to_weights)

            each(walk)
            each(add)


@contextlib.contextmanager
def _threads(n_threads: int) -> Iterator[Callable[[Callable[[int], None]], object]]:
    """Yield a function that calls ``work(0)``, ``work(1)``, ... on ``n_threads`` threads and waits for all."""
    if n_threads == 1:
        yield lambda work: work(0)
        return
    with ThreadPoolExecutor(n_threads) as pool:
        yield lambda work: list(pool.map(work, range(n_threads)))


def _rows(side: _Side, n_lines: int) -> tuple[Array, Array]:
    """Buffers for gradients and drops along ``n_lines`` directions, with room for the additional step."""
    shape = (n_lines, side.n + 1) if side.wanted else (0, 0)
    return np.empty(shape), np.empty(shape)


def _room(sides: list[_Side], group: int) -> list[tuple]:
    """Buffers of one thread for both sides: steps, ends, order, values, and scratch memory of the sort."""
    longest = max(side.n for side in sides)
    shared, scratch = np.empty(longest + 1, np.uint32), sort_scratch(longest)
    rooms = []
    for side in sides:
        steps, ends = np.empty(side.n + 1), np.empty(side.n + 1)
        # The target is sorted first. If its order is not needed later, the source reuses the same buffer.
        order = np.empty(side.n + 1, np.uint32) if side is sides[1] and side.wanted else shared[: side.n + 1]
        values = ends[None] if group == 1 else np.empty((0 if side.wanted else group, side.n + 1))
        rooms.append((steps, ends, order, values, scratch))
    return rooms


def _laid(side: _Side, room: tuple, rows: tuple[Array, Array], own: slice) -> tuple:
    """One side in the format of the kernel. Projections are stored where the gradients are written later."""
    steps, ends, order, values, scratch = room
    gradients, drops = rows[0][own], rows[1][own]
    return (
        side.columns,
        side.weights,
        values if len(values) else gradients,
        steps,
        ends,
        order,
        gradients,
        drops,
        scratch,
    )


def _finished(side: _Side, top: float, n_lines: int) -> list[Array | None]:
    """The mean gradients in points and weights, in the original order of the points."""
    points = weights = None
    if side.to_columns.size:
        side.to_columns[:] /= n_lines
        points = side.to_columns.T
        if side.places is not None:
            points = np.empty((side.n, len(side.columns)))
            points[side.places] = side.to_columns.T
    if side.to_weights.size:
        weights = (top + side.to_weights) / n_lines
        if side.places is not None:
            weights[side.places] = weights.copy()
    return [points, weights]
