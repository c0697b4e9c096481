"""The sliced Wasserstein loss: 1D transport costs averaged over directions."""

import contextlib
import dataclasses
import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import torch
from torch.utils.checkpoint import checkpoint

from meshot.loss._kernel_sliced import SMALL, sort_scratch, spread, walk_lines
from meshot.loss.autograd import public_loss, solved
from meshot.loss.directions import Directions, require_directions
from meshot.loss.exact import exact_slice_costs, exact_sliced_wasserstein
from meshot.measure import DiscreteMeasure, Measure, MeasuresLike, as_pairs
from meshot.rng import Generator
from meshot.types import Array, Float, Int64, Tensor
from meshot.workers import in_chunks


@public_loss
def sliced_wasserstein(
    source: MeasuresLike,
    target: MeasuresLike,
    directions: Directions = 100,
    p: float = 2,
    *,
    seed: Generator = 0,
    reduction: str = "none",
) -> Float[Tensor, "*B"]:
    r"""The Monte Carlo sliced Wasserstein loss SW_p^p: the mean over directions of the 1D transport cost W_p^p.

    .. math::

        \frac{1}{L} \sum_{l=1}^{L} \W_p^p(\theta_l^* \mu, \theta_l^* \nu), \qquad
        \W_p^p(\theta^* \mu, \theta^* \nu) = \int_0^1 |F_\theta^{-1}(z) - G_\theta^{-1}(z)|^p \, dz

    Both measures are projected on the same directions. Along each direction optimal transport is monotone, so its cost
    is an integral over the quantile functions of the two projections. The loss is differentiable with respect to points
    and weights. The gradient in the weights is a Kantorovich potential, defined up to a constant.

    Parameters
    ----------
    source, target : measure, Mesh, Contour, array or tensor, or a batch of them
        Any numbers of support points, any weights; also one of each kind. A mesh means its continuous measure,
        :func:`meshot.surface`. An (n, d) array or tensor means points of equal weight. With a continuous measure the
        cost along every direction is exact, without sampling: see ``meshot.loss.exact``. A (B, n, d) array or tensor, a
        list, and a :class:`meshot.MeasureBatch` are batches; a single measure beside a batch belongs to every pair.
    directions : tensor, array or int
        Unit rows, such as those of :func:`meshot.random_directions`; or the number of directions in the deterministic
        set :func:`meshot.quasi_directions` (``n_projections`` in POT). All pairs of a batch have the same directions.
    p : float
        The exponent, at least 1; 1 or 2 with a continuous measure.
    seed : int or generator
        Of the set of directions, if their number is given. By default every call has the same set, which suits
        evaluation. In a training take new directions in each step: ``seed=step``, or a generator.
    reduction : str
        Of a batch: "none" for a value per pair, "mean" for their mean.

    Returns
    -------
    tensor
        SW_p^p, in (units of the points)^p: the p-th power of the distance, whereas POT returns the distance. A scalar
        for two measures, (B,) for a batch.

    Raises
    ------
    ValueError
        If an argument is not a measure, the measures are in different spaces, the directions do not fit, ``p`` < 1, or
        p is neither 1 nor 2 and a measure is continuous; or if the value exceeds the range of the dtype.

    Notes
    -----
    On a CPU, a compiled kernel processes the directions on ``torch.get_num_threads()`` threads, or the pairs of a batch
    if there are as many: O(L (n + m)) time for spread-out points, and memory for a limited group of directions per
    thread. The result is the same for any number of threads. On other devices PyTorch processes the directions in
    chunks, with the memory of one chunk, and twice for the gradient. If the directions require a gradient,
    :func:`meshot.loss.plain_sliced_wasserstein` is used.

    *Cost.* Points: see ``book/speed.md``. Two continuous surfaces of 150 000 faces take 4 s a step on two cores,
    :func:`meshot.varifold` of them .8 s.

    *Half precision* is computed as float32, which is also the dtype of the value; the gradient has the dtype that came.

    *Second derivatives.* A gradient with ``create_graph=True``, for instance for a gradient penalty, is computed by
    PyTorch operations with O(L (n + m)) memory, and can be differentiated. With a continuous measure this raises a
    ``ValueError`` once the gradient is differentiated.

    References
    ----------
    Bonneel et al., *Sliced and Radon Wasserstein Barycenters of Measures*, 2015; Le et al., ICLR 2024, Equation 5.

    Examples
    --------
    >>> import numpy as np, meshot
    >>> points = np.random.default_rng(0).normal(size=(50, 3))
    >>> lines = meshot.orthogonal_directions(3, 3, generator=0)
    >>> round(float(meshot.sliced_wasserstein(points, points + 1, lines)), 6)  # a translation by t costs |t|²/d
    1.0
    >>> from meshot.mesh.shapes import icosphere
    >>> round(float(meshot.sliced_wasserstein(icosphere(4), icosphere(4, 2.0))), 2)  # spheres: (r − s)²/3
    0.33
    >>> batch = np.random.default_rng(0).normal(size=(4, 50, 3))
    >>> meshot.sliced_wasserstein(batch, batch + 1, 100).shape
    torch.Size([4])
    """
    pairs = as_pairs(source, target, reduction=reduction)
    if pairs.continuous:
        return pairs.reduced(exact_sliced_wasserstein(pairs.items, require_directions(directions, pairs.like, seed), p))
    lines = checked_lines(pairs.like, directions, p, seed)
    if lines.requires_grad:
        return pairs.reduced([plain_costs(*pair, lines, p).mean() for pair in pairs.items])
    if not takes_kernel(pairs.like):
        return pairs.reduced([chunked_costs(*pair, lines, p).mean() for pair in pairs.items])
    return pairs.reduced(mean_of_slices(pairs.items, lines, p, again=plain_value))


@public_loss
def slice_costs(
    source: MeasuresLike, target: MeasuresLike, directions: Directions = 100, p: float = 2
) -> Float[Tensor, "*B L"]:
    """The transport cost W_p^p along every direction. Its mean is :func:`meshot.sliced_wasserstein`.

    Over independent directions these costs are independent, so that the standard error of their mean is their standard
    deviation divided by √L. The arguments are those of :func:`meshot.sliced_wasserstein`.

    Returns
    -------
    tensor
        One cost per direction, in (units of the points)^p; (B, L) for a batch. Differentiable between discrete
        measures. With a continuous measure there is no gradient (their mean, :func:`meshot.sliced_wasserstein`, has
        one).

    Notes
    -----
    If a gradient is needed, the costs are computed by PyTorch operations with O(L (n + m)) memory.

    Examples
    --------
    >>> import numpy as np, meshot
    >>> points = np.random.default_rng(0).normal(size=(50, 3))
    >>> costs = meshot.slice_costs(points, points + np.array([3.0, 0.0, 0.0]), np.eye(3))
    >>> [round(float(cost), 6) for cost in costs]
    [9.0, 0.0, 0.0]
    """
    pairs = as_pairs(source, target)
    if pairs.continuous:
        lines = require_directions(directions, pairs.like)
        return pairs.reduced([exact_slice_costs(*pair, lines, p) for pair in pairs.items])
    lines, costs = checked_lines(pairs.like, directions, p), []
    for one, other in pairs.items:
        tensors = (one.places, one.weights, other.places, other.weights, lines)
        wanted = torch.is_grad_enabled() and any(tensor.requires_grad for tensor in tensors)
        if takes_kernel(pairs.like) and not wanted:
            found, _ = fused_slices(tensors[:4], lines, float(p), (False,) * 4)
            costs.append(torch.from_numpy(found).to(pairs.like))
        else:
            costs.append((plain_costs if wanted else chunked_costs)(one, other, lines, p))
    return pairs.reduced(costs)


# The sliced loss computed by the kernels: division into threads, memory layout, order of the points.

#: Number of floats in the gradient rows that are filled before they are summed: they stay in the cache on one thread.
#: On several, a larger group means that they wait for each other less often.
_GROUP, _GROUP_OF_MANY = 1 << 15, 1 << 17
_ALONE = 1 << 16  # number of projected points below which a second thread does not pay off


def mean_of_slices(
    pairs: Sequence[tuple[Measure, Measure]],
    directions: Float[Tensor, "L d"],
    p: float,
    walk: Callable = walk_lines,
    again: Callable | None = None,
) -> Float[Tensor, " B"]:
    """The mean of the costs along the directions for every pair, differentiable in points and weights."""
    # The arguments are those of :func:`meshot.loss.sliced.fused_slices` and :func:`meshot.loss.autograd.solved`.

    def solve(_: int, tensors: Sequence[Tensor], wanted: Sequence[bool], n_threads: int) -> tuple[float, list]:
        costs, gradients = fused_slices(tensors, directions, float(p), wanted, n_threads, walk)
        return costs.mean(), gradients

    again_of_pair = again and (lambda _, *tensors: again(tensors, directions, p))
    return solved(solve, [tensors_of(*pair) for pair in pairs], again_of_pair)


def tensors_of(source: Measure, target: Measure) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Points and weights of both measures."""
    return source.places, source.weights, target.places, target.weights


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
    """The transport cost along every direction, and the gradients of the mean cost."""
    # Gradients are summed in the order of the directions, so that the number of threads does not matter.
    lines = _array(directions)
    sides = [_side(*measures[k : k + 2], *wanted[k : k + 2]) for k in (0, 2)]
    size = max(side.n for side in sides)
    n_threads = max(1, min(n_threads or torch.get_num_threads(), len(lines), len(lines) * size // _ALONE))
    per_thread = -(-len(lines) // n_threads)
    n_rounds = -(-per_thread // max(1, (_GROUP if n_threads == 1 else _GROUP_OF_MANY) // size))
    group = -(-per_thread // n_rounds)
    costs, tops = np.empty(len(lines)), np.zeros((len(lines), 2))
    # Gradients and drops of every direction of a round, with room for the additional step.
    rows, n_rows = [], n_threads * group
    for side in sides:
        lengths = (side.n + 1, side.n + 1 if side.to_weights.size else 0)
        rows.append([np.empty((n_rows, length) if side.wanted else (0, 0)) for length in lengths])
    buffers = [_thread_buffers(sides, group) for _ in range(n_threads)]
    # One thread computes all groups in one call, and their sums. Several compute a group each, and then parts of the
    # sums, in the same order.
    alone, step = n_threads == 1, len(lines) if n_threads == 1 else n_threads * group
    with ThreadPoolExecutor(n_threads) if not alone else contextlib.nullcontext() as pool:
        for start in range(0, len(lines), step):
            block = slice(start, start + step)
            n_lines = len(lines[block])

            def costs_of_thread(k: int, block: slice = block, n_lines: int = n_lines) -> None:
                own = slice(n_lines * k // n_threads, n_lines * (k + 1) // n_threads)
                laid = []
                for side, (steps, ends, order, values, scratch), (gradients, drops) in zip(sides, buffers[k], rows):
                    # Projections are stored where the gradients are written later.
                    values = values if len(values) else gradients[own]
                    kept = (steps, ends, order, gradients[own], drops[own], scratch)
                    sums = (side.to_columns, side.to_weights) if alone else (np.empty((0, 0)), np.empty(0))
                    laid.append((side.columns, side.weights, values, *kept, *sums))
                walk(lines[block][own], group, p, *laid, costs[block][own], tops[block][own])

            def sums_of_thread(k: int, block: slice = block) -> None:
                for side, (gradients, drops) in zip(sides, rows):
                    if side.wanted:
                        bounds = side.n * k // n_threads, side.n * (k + 1) // n_threads
                        spread(gradients, drops, lines[block], *bounds, side.to_columns, side.to_weights)

            for work in (costs_of_thread,) if alone else (costs_of_thread, sums_of_thread):
                list((map if pool is None else pool.map)(work, range(n_threads)))
    rows.clear()  # the peak of memory would come below
    buffers.clear()
    # The mean gradients in points and weights, in the original order of the points.
    gradients = []
    for side, top in zip(sides, tops.sum(axis=0)):
        points = weights = None
        if side.to_columns.size:
            side.to_columns[:] /= len(lines)
            points = side.to_columns.T
            if side.places is not None:
                points = np.empty((side.n, len(side.columns)))
                points[side.places] = side.to_columns.T
        if side.to_weights.size:
            weights = (top + side.to_weights) / len(lines)
            if side.places is not None:
                weights[side.places] = weights.copy()
        gradients += [points, weights]
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
        # Points that are close in space have close projections. Storing them together improves cache use: in the order
        # along a Morton curve in the three coordinates of largest extent.
        extents = rows.max(axis=0) - rows.min(axis=0)
        code = np.zeros(len(rows), np.int64)
        for axis, k in enumerate(np.argsort(-extents)[:3]):
            scale = 1023 / extents[k] if 0 < extents[k] < np.inf else 0.0
            cells = ((rows[:, k] - rows[:, k].min()) * scale).astype(np.int64)
            # Insert two zero bits between neighbouring bits of a ten-bit number.
            for shift, mask in ((16, 0x30000FF), (8, 0x300F00F), (4, 0x30C30C3), (2, 0x9249249)):
                cells = (cells | cells << shift) & mask
            code |= cells << axis
        places = np.argsort(code).astype(np.int32)
        columns, masses = np.empty(rows.shape[::-1]), masses[places]
        for column, values in zip(columns, rows.T):
            np.take(values, places, out=column)
    else:
        columns = np.ascontiguousarray(rows.T)
    to_columns = np.zeros(columns.shape if wants_points else (0, 0))
    return _Side(columns, masses, places, to_columns, np.zeros(len(masses) if wants_weights else 0))


def _array(values: Tensor) -> Array:
    return np.ascontiguousarray(values.detach().double().cpu().numpy())


def _thread_buffers(sides: list[_Side], group: int) -> list[tuple]:
    """Buffers of one thread for both sides: steps, ends, order, values, and scratch memory of the sort."""
    longest = max(side.n for side in sides)
    shared, scratch = np.empty(longest + 1, np.uint32), sort_scratch(longest)
    buffers = []
    for side in sides:
        steps, ends = np.empty(side.n + 1), np.empty(side.n + 1)
        # The target is sorted first. If its order is not needed later, the source reuses the same buffer.
        order = np.empty(side.n + 1, np.uint32) if side is sides[1] and side.wanted else shared[: side.n + 1]
        values = ends[None] if group == 1 else np.empty((0 if side.wanted else group, side.n + 1))
        buffers.append((steps, ends, order, values, scratch))
    return buffers


# The sliced loss in PyTorch operations: transport on many lines at once, on any device.


@public_loss
def plain_sliced_wasserstein(
    source: MeasuresLike,
    target: MeasuresLike,
    directions: Directions = 100,
    p: float = 2,
    *,
    seed: Generator = 0,
    reduction: str = "none",
) -> Float[Tensor, "*B"]:
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
    pairs = as_pairs(source, target, of_points=True, reduction=reduction)
    lines = checked_lines(pairs.like, directions, p, seed)
    return pairs.reduced([plain_costs(*pair, lines, p).mean() for pair in pairs.items])


def checked_lines(like: Tensor, directions: Directions, p: float, seed: Generator = 0) -> Float[Tensor, "L d"]:
    """The directions as unit rows in the space of some points, after a check of the exponent."""
    require_exponent(p)
    return require_directions(directions, like, seed)


def require_exponent(p: float) -> None:
    """Check the exponent of a ground cost."""
    if not 1 <= p < math.inf:
        raise ValueError(f"p is {p!r}; a finite number >= 1 is needed (below one, sorting is not optimal)")


def plain_costs(source: Measure, target: Measure, directions: Float[Tensor, "L d"], p: float) -> Float[Tensor, " L"]:
    """W_p^p between two measures of points along every direction, differentiable with respect to all arguments."""
    projected, projected_target = directions @ source.places.T, directions @ target.places.T
    if same_equal_masses(source.weights, target.weights):
        return paired_cost(projected, projected_target, p)
    return quantile_cost(projected, source.weights, projected_target, target.weights, p)


def plain_value(tensors: Sequence[Tensor], directions: Float[Tensor, "L d"], p: float) -> Float[Tensor, ""]:
    """The mean of :func:`meshot.loss.sliced.plain_costs`, for points and weights of both sides."""
    return plain_costs(DiscreteMeasure(*tensors[:2]), DiscreteMeasure(*tensors[2:]), directions, p).mean()


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
    source_order, target_order = row_order(source), row_order(target)
    source, target = source.gather(1, source_order), target.gather(1, target_order)
    source_mass = source_weights[source_order].cumsum(dim=1)  # (L, n): where each step of F⁻¹ ends
    target_mass = target_weights[target_order].cumsum(dim=1)
    # The jumps of both step functions divide [0, 1] into n + m cells, on which they are constant.
    ends = torch.cat([source_mass, target_mass], dim=1)
    order = row_order(ends, "stable")
    cell_ends = ends.gather(1, order)
    # The number of steps of either side that end before a cell is the index of its step.
    of_source = (order < source.shape[1]).long()
    ended = of_source.cumsum(dim=1) - of_source
    source_step = ended.clamp(max=source.shape[1] - 1)
    target_step = (torch.arange(ends.shape[1], device=ends.device) - ended).clamp(max=target.shape[1] - 1)
    gap = source.gather(1, source_step) - target.gather(1, target_step)
    mass = torch.diff(cell_ends, dim=1, prepend=torch.zeros_like(cell_ends[:, :1]))
    return (power(gap, p) * mass).sum(dim=1)


def power(gap: Tensor, p: float) -> Tensor:
    """|gap|^p. The square is computed without a root or logarithm, so that gradients are finite at zero."""
    if p == 2:
        return gap.square()
    return gap.abs() if p == 1 else gap.abs().pow(p)


# The sliced loss on devices other than the CPU: directions in chunks, to limit memory.

_CHUNK = 1 << 22  # projected points of both sides per chunk, each of which takes about ten numbers of memory


def chunked_costs(source: Measure, target: Measure, directions: Float[Tensor, "L d"], p: float) -> Float[Tensor, " L"]:
    """The values of :func:`meshot.loss.sliced.plain_costs` with the memory of one chunk of directions."""
    # For the gradient every chunk is computed a second time.
    chunks = directions.split(max(1, _CHUNK // (len(source.places) + len(target.places))))
    return torch.cat([checkpoint(plain_costs, source, target, chunk, p, use_reentrant=False) for chunk in chunks])
