"""Sliced Wasserstein in spatial windows, so that measures are compared locally.

This loss is our addition. The paper compares the whole measures.
"""

import contextlib
import dataclasses
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
import torch
from torch.autograd.function import once_differentiable

from meshot.errors import as_floating, as_points, require_positive, require_positive_integer
from meshot.loss._kernel_sliced import find_in_window
from meshot.loss.directions import Directions, quasi_directions, random_directions
from meshot.loss.sliced import checked_lines, fused_slices, sliced_wasserstein
from meshot.measure import DiscreteMeasure, Measure, MeasureLike, as_point_measures
from meshot.rng import Generator, numpy_generator
from meshot.types import Array, Float, Tensor

#: The centres of windows, and a set of directions for each.
Windows = tuple[Float[Tensor, "K k"], Float[Tensor, "K L d"]]


def windowed_sliced_wasserstein(
    source: MeasureLike,
    target: MeasureLike,
    centres: Float[Tensor, "K k"],
    radius: float,
    directions: Directions = 100,
    p: float = 2,
) -> Float[Tensor, ""]:
    """The mean over windows of SW_p^p between both measures, restricted to the window and normalised.

    A window is a Gaussian around a centre, cut off at 2.5 radii. If two surfaces differ in area locally, their
    normalised measures differ in mass everywhere, and transport moves this difference across the whole shape. Within a
    window only the mass that is missing relative to the neighbourhood is moved, over short distances. The loss is zero
    between equal measures. It is not symmetric if the centres are drawn from one of the two.

    Parameters
    ----------
    source, target : measure of points, Mesh, Contour, array or tensor
        An (n, d) array or tensor means points of equal weight, a mesh the barycentres of its faces, weighted by area.
    centres : tensor
        The centres in the first k coordinates of the measures (for a varifold three: positions, not normals).
    radius : float
        Standard deviation of the windows, in the units of the points.
    directions : tensor, array or int
        Unit rows, with a set for every window: (K, L, d). Or their number L per window: window k then uses
        :func:`meshot.quasi_directions` with seed k.
    p : float
        The exponent, at least 1.

    Returns
    -------
    tensor
        In (units of the points)^p. In the gradient the window weights are constant, so that points are not driven out
        of windows.

    Raises
    ------
    ValueError
        If an argument is not a measure of points, the shapes do not fit, the radius is not a positive number, or no
        window contains mass of both measures.

    Notes
    -----
    Compiled kernels compute the windows on ``torch.get_num_threads()`` threads of the CPU in float64, also for tensors
    on other devices. The result is the same for any number of threads. Only first derivatives are available. If the
    directions require a gradient, the windows are computed one after the other by PyTorch.

    *Axioms.* Windows without mass of one measure are left out. If all windows hold mass of all measures, the p-th root
    is a pseudo-metric for fixed windows and directions: it is a mean of powers of distances between normalised
    restrictions, so that the triangle inequality holds. It can fail if windows are left out. The loss is zero
    between measures that are proportional in every window. Even with windows around all points of space, parts that are
    more than 5 radii apart may therefore exchange mass unseen. If the points of both measures are linked by steps
    shorter than 5 radii and one window holds mass of both, all windows together are zero between equal measures only:
    two windows that share mass have the same factor, and along a chain of steps this factor stays the same.

    *Limits.* For radius → ∞ the loss tends to :func:`meshot.sliced_wasserstein`, with an error proportional to
    radius⁻². Two parallel sheets at a distance h cost the mean p-th power of ⟨θ, h n⟩ while h is well below 2.5 radii;
    beyond, no window around one sheet holds mass of the other. For radius → 0, only windows around common points of
    both surfaces are left. There the cost of the positions falls like the p-th power of the radius and depends on the
    angle between the tangent planes. The normals of a varifold cost the distance of the two scaled normals.

    Examples
    --------
    >>> import numpy as np, torch, meshot
    >>> points = np.random.default_rng(0).normal(size=(50, 3))
    >>> centres = torch.zeros(1, 3, dtype=torch.float64)
    >>> round(float(meshot.windowed_sliced_wasserstein(points, points, centres, radius=1.0)), 9)
    0.0
    """
    pair = _checked(source, target, centres, radius, directions, p)
    if pair.source.places.dtype in (torch.float32, torch.float64) and not pair.lines.requires_grad:
        tensors, *windows = pair.on_cpu()
        value, n_counted = _FusedWindows.apply(*tensors, *windows, float(p))
        _require_counted(int(n_counted), pair)
        return value.to(pair.source.places.device)
    costs = []
    for centre, lines in zip(pair.centres, pair.lines, strict=True):
        inside = [_restricted(measure, centre, radius) for measure in (pair.source, pair.target)]
        if None not in inside:
            costs.append(sliced_wasserstein(*inside, lines, p))
    _require_counted(len(costs), pair)
    return torch.stack(costs).mean()


def window_costs(source: Measure, target: Measure, windows: Windows, radius: float, p: float) -> Float[Array, " n"]:
    """SW_p^p in every window that holds mass of both measures, whose mean is the windowed loss. Without gradients."""
    # The windows are those of :func:`drawn_windows`. The other arguments, and the errors, are those of
    # :func:`meshot.windowed_sliced_wasserstein`.
    centres, directions = windows
    pair = _checked(source, target, centres, radius, directions, p)
    costs, _ = fused_windows(*pair.on_cpu(), float(p), [False] * 4)
    _require_counted(len(costs), pair)
    return costs


def drawn_windows(target: Measure, n_windows: int, n_directions: int, generator: Generator) -> Windows:
    """Centres at positions of the target, drawn by mass, and random directions for every window."""
    # Positions are the first three coordinates of a place, or all if there are fewer.
    places, draw = target.places, numpy_generator(generator)
    lines = random_directions(n_windows * n_directions, places.shape[1], draw).to(places)
    shares = target.weights.detach().double().cpu().numpy()
    drawn = draw.choice(len(shares), n_windows, p=shares / shares.sum())
    centres = places.detach()[torch.from_numpy(drawn).to(places.device), :3]
    return centres, lines.reshape(n_windows, n_directions, -1)


class _Pair(NamedTuple):
    """Two measures, and the windows in which they are compared."""

    source: Measure
    target: Measure
    centres: Float[Tensor, "K k"]
    radius: float
    lines: Float[Tensor, "K L d"]

    def on_cpu(self) -> tuple[list[Tensor], Tensor, float, Tensor]:
        """The measures as tensors, and the windows, in the format of the kernels."""
        tensors = (self.source.places, self.source.weights, self.target.places, self.target.weights)
        return [tensor.cpu() for tensor in tensors], self.centres.cpu(), float(self.radius), self.lines.cpu()


def _checked(
    source: MeasureLike,
    target: MeasureLike,
    centres: Float[Tensor, "K k"],
    radius: float,
    directions: Directions,
    p: float,
) -> _Pair:
    source, target = as_point_measures(source, target)
    centres = as_points(centres, "centres")
    n_windows, n_dimensions = centres.shape
    if n_dimensions > source.places.shape[1]:
        raise ValueError(
            f"centres has {n_dimensions} coordinates, the points {source.places.shape[1]}: at most as many are needed"
        )
    like, d = source.places, source.places.shape[1]
    if isinstance(directions, int | np.integer):
        n = require_positive_integer(directions, "directions")
        directions = torch.stack([quasi_directions(n, d, k, like.dtype, like.device) for k in range(n_windows)])
    directions = as_floating(directions, "directions")
    if directions.ndim != 3 or len(directions) != n_windows:
        raise ValueError(
            f"directions has shape {tuple(directions.shape)}; ({n_windows}, L, {d}) is needed, a set for every window, "
            "or a number"
        )
    require_positive(radius, "radius", "the units of the points")
    lines = checked_lines(source, directions.flatten(0, 1), p).reshape(directions.shape)
    return _Pair(source, target, centres, radius, lines)


def _require_counted(n_counted: int, pair: _Pair) -> None:
    if not n_counted:
        raise ValueError(
            f"none of {len(pair.centres)} windows of radius {pair.radius:g} holds mass of both measures: they may lie "
            "in different places, or take a larger radius"
        )


def _restricted(measure: Measure, centre: Float[Tensor, " k"], radius: float) -> DiscreteMeasure | None:
    """The measure weighted by a window and normalised; None if it has no mass there."""
    places = measure.places.detach()[:, : len(centre)]
    squared = ((places - centre) ** 2).sum(dim=1)
    (inside,) = torch.nonzero(squared < (REACH * radius) ** 2, as_tuple=True)
    weights = measure.weights[inside] * torch.exp(-squared[inside] / (2 * radius**2))
    total = weights.sum()
    if not float(total.detach()) > 0:
        return None
    return DiscreteMeasure(measure.places[inside], weights / total)


# The windowed loss computed by the kernels: a window at a time, several windows on several threads.

#: Cut-off of a window, in units of its radius. The Gaussian has decreased to about 1/20 there.
REACH = 2.5
_AHEAD = 8  # windows per thread whose gradients are held before they are added
_ALONE = 1 << 16  # number of points, over all windows, below which a second thread does not pay off


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


def fused_windows(
    measures: Sequence[Tensor],
    centres: Float[Tensor, "K k"],
    radius: float,
    directions: Float[Tensor, "K L d"],
    p: float,
    wanted: Sequence[bool],
) -> tuple[Float[Array, " n"], list[Array | None]]:
    """The cost in every window that holds mass of both measures, and the gradients of the mean of these costs."""
    places = centres.detach().double().numpy()
    arrays = [np.ascontiguousarray(tensor.detach().double().numpy()) for tensor in measures]
    sides = [
        _Side(rows, np.ascontiguousarray(rows[:, : places.shape[1]].T), masses)
        for rows, masses in (arrays[:2], arrays[2:])
    ]
    lines = directions.detach().double()
    totals = [np.zeros(t.shape) if want else None for t, want in zip(measures, wanted)]
    costs = []

    def work(k: int) -> tuple[float, list[Array], list[Array | None]] | None:
        """The cost in one window, the points of its four gradients, and these; None if a measure has no mass there."""
        chosen, factors, measures = [], [], []
        for side in sides:
            inside, values = np.empty(len(side.weights), np.int64), np.empty(len(side.weights))
            count = find_in_window(side.columns, places[k], radius, REACH * radius, inside, values)
            masses = side.weights[inside[:count]] * values[:count]
            total = masses.sum()
            if not total > 0:
                return None
            chosen += [inside[:count].copy()] * 2
            factors.append(values[:count] / total)
            measures += [torch.from_numpy(side.rows[chosen[-1]]), torch.from_numpy(masses / total)]
        del inside, values, masses  # as long as the whole measure
        found, gradients = fused_slices(measures, lines[k], float(p), wanted, n_threads=1)
        for i, (shares, factor) in zip((1, 3), zip(measures[1::2], factors)):
            if wanted[i]:  # the masses in the window are divided by their sum
                gradients[i] = factor * (gradients[i] - shares.numpy() @ gradients[i])
        return found.mean(), chosen, gradients

    n_points = len(places) * sum(len(side.weights) for side in sides)
    n_threads = max(1, min(torch.get_num_threads(), len(places), n_points // _ALONE))
    step = _AHEAD * n_threads
    with ThreadPoolExecutor(n_threads) if n_threads > 1 else contextlib.nullcontext() as pool:
        for start in range(0, len(places), step):
            block = range(start, min(start + step, len(places)))
            for found in map(work, block) if pool is None else pool.map(work, block):
                if found is not None:
                    costs.append(found[0])
                    for total, chosen, gradient in zip(totals, *found[1:]):
                        if total is not None:
                            total[chosen] += gradient
    return np.array(costs), [None if total is None else total / max(1, len(costs)) for total in totals]


@dataclasses.dataclass(frozen=True, eq=False)
class _Side:
    rows: Float[Array, "n d"]
    columns: Float[Array, "k n"]
    weights: Float[Array, " n"]
