"""Sliced Wasserstein in spatial windows, so that measures are compared locally.

This loss is our addition. The paper compares the whole measures.
"""

import contextlib
import dataclasses
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import torch

from meshot.errors import as_floating, as_points, require_positive, require_positive_integer
from meshot.loss._kernel_sliced import find_in_window
from meshot.loss.autograd import public_loss, solved
from meshot.loss.directions import Directions, drawn_seed, quasi_directions, random_directions, require_directions
from meshot.loss.sliced import fused_slices, plain_costs, require_exponent, tensors_of
from meshot.measure import DiscreteMeasure, Measure, MeasuresLike, as_pairs
from meshot.rng import Generator, numpy_generator
from meshot.types import Array, Float, Tensor

#: The centres of windows, and a set of directions for each.
Windows = tuple[Float[Tensor, "K k"], Float[Tensor, "K L d"]]


@public_loss
def windowed_sliced_wasserstein(
    source: MeasuresLike,
    target: MeasuresLike,
    centres: Float[Tensor, "*P K k"] | Sequence[Tensor],
    radius: float,
    directions: Directions | Sequence[Tensor] = 100,
    p: float = 2,
    *,
    seed: Generator = 0,
    reduction: str = "none",
) -> Float[Tensor, "*B"]:
    """The mean over windows of SW_p^p between both measures, restricted to the window and normalised.

    A window is a Gaussian around a centre, cut off at 2.5 radii. If two surfaces differ in area locally, their
    normalised measures differ in mass everywhere, and transport moves this difference across the whole shape. Within a
    window only the mass that is missing relative to the neighbourhood is moved, over short distances. The loss is zero
    between equal measures. It is not symmetric if the centres are drawn from one of the two.

    Parameters
    ----------
    source, target : measure of points, Mesh, Contour, array or tensor, or a batch of them
        An (n, d) array or tensor means points of equal weight, a mesh the barycentres of its faces, weighted by area.
    centres : tensor
        The centres in the first k coordinates of the measures (for a varifold three: positions, not normals). A batch
        has the same windows for every pair, or, from (B, K, k) centres or a list, its own.
    radius : float
        Standard deviation of the windows, in the units of the points.
    directions : tensor, array or int
        Unit rows, with a set for every window: (K, L, d), or (B, K, L, d) or a list for windows of every pair. Or their
        number L per window: window k then uses :func:`meshot.quasi_directions` with seed k.
    p : float
        The exponent, at least 1.
    seed : int or generator
        Of the directions, if their number is given: s draws the seeds s K + k of the windows k.
    reduction : str
        Of a batch: "none" for a value per pair, "mean" for their mean.

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
    on other devices. The result is the same for any number of threads. If the directions require a gradient, or the
    gradient is to be differentiated (``create_graph=True``), the windows are computed one after the other by PyTorch.

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
    pairs = as_pairs(source, target, of_points=True, reduction=reduction)
    windows = _of_every_pair(centres, directions, len(pairs.items))
    windows = [_checked(*pair, *own, radius, p, seed) for pair, own in zip(pairs.items, windows, strict=True)]
    if any(lines.requires_grad for _, lines in windows):
        own = zip(pairs.items, windows, strict=True)
        return pairs.reduced([_plain_windows(*pair, *each, radius, p) for pair, each in own])

    def solve(k: int, tensors: Sequence[Tensor], wanted: Sequence[bool], n_threads: int) -> tuple[float, list]:
        costs, gradients = fused_windows(tensors, windows[k], float(radius), float(p), wanted, n_threads)
        return costs.mean(), gradients

    def again(k: int, *tensors: Tensor) -> Tensor:
        return _plain_windows(DiscreteMeasure(*tensors[:2]), DiscreteMeasure(*tensors[2:]), *windows[k], radius, p)

    return pairs.reduced(solved(solve, [tensors_of(*pair) for pair in pairs.items], again))


def window_costs(source: Measure, target: Measure, windows: Windows, radius: float, p: float) -> Float[Array, " n"]:
    """SW_p^p in every window that holds mass of both measures, whose mean is the windowed loss. Without gradients."""
    # The windows are those of :func:`drawn_windows`. The other arguments, and the errors, are those of
    # :func:`meshot.windowed_sliced_wasserstein`.
    windows = _checked(source, target, *windows, radius, p)
    return fused_windows(tensors_of(source, target), windows, float(radius), float(p), [False] * 4)[0]


def drawn_windows(target: Measure, n_windows: int, n_directions: int, generator: Generator) -> Windows:
    """Centres at positions of the target, drawn by mass, and random directions for every window."""
    # Positions are the first three coordinates of a place, or all if there are fewer.
    places, draw = target.places, numpy_generator(generator)
    lines = random_directions(n_windows * n_directions, places.shape[1], draw).to(places)
    shares = target.weights.detach().double().cpu().numpy()
    drawn = draw.choice(len(shares), n_windows, p=shares / shares.sum())
    centres = places.detach()[torch.from_numpy(drawn).to(places.device), :3]
    return centres, lines.reshape(n_windows, n_directions, -1)


def _of_every_pair(centres: object, directions: object, n_pairs: int) -> list[tuple[object, object]]:
    """The centres and directions of every pair: their own, or the same for all."""
    sides = []
    for values, name, ndim in ((centres, "centres", 2), (directions, "directions", 3)):
        own = isinstance(values, list | tuple) or getattr(values, "ndim", 0) == ndim + 1
        if own and len(values) != n_pairs:
            raise ValueError(f"{name} holds {len(values)} sets; {n_pairs} are needed, one for every pair")
        sides.append(values if own else [values] * n_pairs)
    return list(zip(*sides, strict=True))


def _checked(
    source: Measure,
    target: Measure,
    centres: object,
    directions: object,
    radius: float,
    p: float,
    seed: Generator = 0,
) -> Windows:
    """The windows of one pair, in its space."""
    centres = as_points(centres, "centres")
    n_windows, n_dimensions = centres.shape
    if n_dimensions > source.places.shape[1]:
        raise ValueError(
            f"centres has {n_dimensions} coordinates, the points {source.places.shape[1]}: at most as many are needed"
        )
    like, d = source.places, source.places.shape[1]
    if isinstance(directions, int | np.integer):
        n, first = require_positive_integer(directions, "directions"), n_windows * drawn_seed(seed)
        sets = [quasi_directions(n, d, first + k, like.dtype, like.device) for k in range(n_windows)]
        directions, seed = torch.stack(sets), 0
    directions = as_floating(directions, "directions")
    if directions.ndim != 3 or len(directions) != n_windows:
        raise ValueError(
            f"directions has shape {tuple(directions.shape)}; ({n_windows}, L, {d}) is needed, a set for every window, "
            "or a number"
        )
    require_positive(radius, "radius", "the units of the points")
    require_exponent(p)
    return centres, require_directions(directions.flatten(0, 1), like, seed).reshape(directions.shape)


def _require_counted(n_counted: int, n_windows: int, radius: float) -> None:
    if not n_counted:
        raise ValueError(
            f"none of {n_windows} windows of radius {radius:g} holds mass of both measures: they may lie in different "
            "places, or take a larger radius"
        )


def _plain_windows(
    source: Measure,
    target: Measure,
    centres: Float[Tensor, "K k"],
    directions: Float[Tensor, "K L d"],
    radius: float,
    p: float,
) -> Float[Tensor, ""]:
    """The loss of one pair by PyTorch operations, window by window."""
    costs = []
    for centre, lines in zip(centres, directions, strict=True):
        inside = [_restricted(measure, centre, radius) for measure in (source, target)]
        if None not in inside:
            costs.append(plain_costs(*inside, lines, p).mean())
    _require_counted(len(costs), len(centres), radius)
    return torch.stack(costs).mean()


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


def fused_windows(
    measures: Sequence[Tensor],
    windows: Windows,
    radius: float,
    p: float,
    wanted: Sequence[bool],
    n_threads: int | None = None,
) -> tuple[Float[Array, " n"], list[Array | None]]:
    """The cost in every window that holds mass of both measures, and the gradients of the mean of these costs."""
    places = windows[0].detach().double().cpu().numpy()
    arrays = [np.ascontiguousarray(tensor.detach().double().cpu().numpy()) for tensor in measures]
    sides = [
        _Side(rows, np.ascontiguousarray(rows[:, : places.shape[1]].T), masses)
        for rows, masses in (arrays[:2], arrays[2:])
    ]
    lines = windows[1].detach().double().cpu()
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
    n_threads = max(1, min(n_threads or torch.get_num_threads(), len(places), n_points // _ALONE))
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
    _require_counted(len(costs), len(places), radius)
    return np.array(costs), [None if total is None else total / len(costs) for total in totals]


@dataclasses.dataclass(frozen=True, eq=False)
class _Side:
    rows: Float[Array, "n d"]
    columns: Float[Array, "k n"]
    weights: Float[Array, " n"]
