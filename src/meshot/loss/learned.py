"""Slices that depend on the measures: the worst one, weighted ones, corrected ones, and those that lift to a plan.

The sliced loss weights all directions equally. Here the direction of largest cost is searched, costs are weighted by
their size or corrected by functions of known mean, and the order along a line or a curve pairs the points of space.
"""

import functools
import itertools
import math
from collections.abc import Sequence

import numpy as np
import torch

from meshot.errors import require_choice, require_natural, require_positive, require_positive_integer
from meshot.loss.autograd import differentiable_once, public_loss
from meshot.loss.directions import Directions, drawn_seed
from meshot.loss.sliced import (
    checked_lines,
    chunked_costs,
    fused_slices,
    plain_costs,
    require_exponent,
    row_order,
    same_equal_masses,
    takes_kernel,
    tensors_of,
)
from meshot.measure import DiscreteMeasure, Measure, MeasuresLike, as_pairs
from meshot.rng import Generator, numpy_generator
from meshot.types import Array, Float, Int64, Tensor

# Costs along all directions, with a gradient in each of them: what a loss that weights its slices is made of.


def line_costs(source: Measure, target: Measure, directions: Float[Tensor, "L d"], p: float) -> Float[Tensor, " L"]:
    """W_p^p along every direction, differentiable in points and weights, with the time and memory of the kernels."""
    if directions.requires_grad:
        return plain_costs(source, target, directions, p)
    if not takes_kernel(source.places):
        return chunked_costs(source, target, directions, p)
    return _LineCosts.apply(directions, float(p), *tensors_of(source, target))


class _LineCosts(torch.autograd.Function):
    """The costs by the kernels, and once more in the backward pass, when the factor of each cost is known."""

    @staticmethod
    def forward(ctx, directions, p, *tensors):
        costs, _ = fused_slices(tensors, directions, p, (False,) * 4)
        ctx.directions, ctx.p = directions, p
        ctx.save_for_backward(*tensors)
        return torch.from_numpy(costs).to(tensors[0])

    @staticmethod
    def backward(ctx, grad_output):
        tensors, wanted = ctx.saved_tensors, ctx.needs_input_grad[2:]
        chosen = [k for k, want in enumerate(wanted) if want]
        if torch.is_grad_enabled():  # create_graph=True
            costs = plain_costs(DiscreteMeasure(*tensors[:2]), DiscreteMeasure(*tensors[2:]), ctx.directions, ctx.p)
            inputs = [tensors[k] for k in chosen]
            found = torch.autograd.grad(costs, inputs, grad_output, create_graph=True, materialize_grads=True)
        else:
            totals = {k: torch.zeros_like(tensors[k], dtype=torch.float64) for k in chosen}
            for sign in (1, -1):
                factors = (sign * grad_output).double().clamp(min=0)
                own = factors > 0
                if bool(own.any()):
                    # Along a direction s times as long, the cost is s^p times as large. The kernel returns the mean.
                    lengths = (int(own.sum()) * factors[own]) ** (1 / ctx.p)
                    longer = ctx.directions[own].double() * lengths[:, None]
                    _, gradients = fused_slices(tensors, longer, ctx.p, wanted)
                    for k in chosen:
                        totals[k] += sign * torch.from_numpy(gradients[k])
            found = [totals[k].to(tensors[k]) for k in chosen]
        gradients = dict(zip(chosen, found, strict=True))
        return None, None, *(gradients.get(k) for k in range(4))


def _in_range(value: Float[Tensor, ""]) -> Float[Tensor, ""]:
    if not bool(torch.isfinite(value)):
        raise ValueError(f"the loss exceeds the range of {value.dtype}: scale both measures down")
    return value


# The direction of largest cost.


@public_loss
def max_sliced_wasserstein(
    source: MeasuresLike,
    target: MeasuresLike,
    directions: Directions = 100,
    p: float = 2,
    n_steps: int = 20,
    *,
    seed: Generator = 0,
    reduction: str = "none",
) -> Float[Tensor, "*B"]:
    r"""The max-sliced Wasserstein loss: the largest transport cost W_p^p along a direction.

    .. math::

        \max_{|\theta| = 1} \W_p^p(\theta^* \mu, \theta^* \nu)

    The cost is computed along all given directions. From the best one, an ascent on the sphere follows the gradient in
    the direction. The value is therefore a lower bound of the maximum, which has other local maxima.

    Parameters
    ----------
    source, target : measure of points, Mesh, Contour, array or tensor, or a batch of them
        An (n, d) array or tensor means points of equal weight, a mesh the barycentres of its faces, weighted by area.
    directions, seed, reduction
        As :func:`meshot.sliced_wasserstein`. In a training, the direction of the last step can be handed over, as a
        tensor of shape (1, d), with a few steps.
    p : float
        The exponent, at least 1.
    n_steps : int
        Most steps of the ascent, each with the time of one direction. With 0 the value is the largest of the costs.

    Returns
    -------
    tensor
        In (units of the points)^p. In the gradient the direction is constant. By Danskin's theorem this is exact at a
        unique maximum at which the cost is differentiable.

    Raises
    ------
    ValueError
        If an argument does not fit, or the value exceeds the range of the dtype.

    Notes
    -----
    The cost has kinks where two projected points change their order. A maximum often lies at one, where several
    gradients are valid, and an ascent can stop at a kink just below a local maximum. There are no second derivatives,
    because they would contain that of the direction.

    References
    ----------
    Deshpande et al., *Max-Sliced Wasserstein Distance and its Use for GANs*, CVPR 2019.

    Examples
    --------
    >>> import numpy as np
    >>> from meshot.loss import max_sliced_wasserstein
    >>> points = np.random.default_rng(0).normal(size=(50, 3))
    >>> round(float(max_sliced_wasserstein(points, points + np.array([3.0, 0, 4.0]), 5)), 6)  # a translation: |t|²
    25.0
    """
    pairs = as_pairs(source, target, of_points=True, reduction=reduction)
    starts = checked_lines(pairs.like, directions, p, seed)
    require_natural(n_steps, "n_steps")
    values = []
    for one, other in pairs.items:
        best = _steepest(one, other, starts, p, n_steps)
        values.append(_in_range(line_costs(one, other, best[None], p)[0]))
    return differentiable_once(pairs.reduced(values))


@public_loss
def max_sliced_direction(
    source: MeasuresLike,
    target: MeasuresLike,
    directions: Directions = 100,
    p: float = 2,
    n_steps: int = 20,
    *,
    seed: Generator = 0,
) -> Float[Tensor, "*B d"]:
    """The direction at which :func:`meshot.loss.max_sliced_wasserstein` has its value, a unit vector.

    The arguments are the same. Of a batch it is (B, d), one for every pair. Its sign has no meaning.

    Examples
    --------
    >>> import numpy as np
    >>> from meshot.loss import max_sliced_direction
    >>> points = np.random.default_rng(0).normal(size=(50, 2))
    >>> [round(abs(x), 6) for x in max_sliced_direction(points, points + np.array([3.0, 4.0]), 5).tolist()]
    [0.6, 0.8]
    """
    pairs = as_pairs(source, target, of_points=True)
    starts = checked_lines(pairs.like, directions, p, seed)
    require_natural(n_steps, "n_steps")
    return pairs.reduced([_steepest(*pair, starts, p, n_steps) for pair in pairs.items])


@torch.no_grad()
def _steepest(source: Measure, target: Measure, starts: Float[Tensor, "L d"], p: float, n_steps: int) -> Tensor:
    """The best direction that an ascent finds from the best start."""
    first = line_costs(source, target, starts, p).argmax() if len(starts) > 1 else 0
    line, scale = starts[first].double(), 1.0
    tensors = [tensor.detach().double() for tensor in tensors_of(source, target)]
    cost, slope = _cost_and_slope(tensors, line, p)
    for _ in range(n_steps):
        tangent = slope - (slope @ line) * line
        size = float(torch.linalg.vector_norm(tangent))
        if size <= 1e-14 * float(cost) or scale < 1e-9:
            break
        # Along the great circle. At scale 1 and p = 2 this is a step of the power method: the slope, normalised.
        angle = min(scale * math.atan2(size, float(slope @ line)), math.pi / 2)
        further = math.cos(angle) * line + math.sin(angle) / size * tangent
        further = further / torch.linalg.vector_norm(further)
        higher, its_slope = _cost_and_slope(tensors, further, p)
        if higher > cost:
            line, cost, slope, scale = further, higher, its_slope, 2 * scale
        else:
            scale /= 4
    return line.to(starts)


def _cost_and_slope(tensors: Sequence[Tensor], line: Float[Tensor, " d"], p: float) -> tuple[Tensor, Tensor]:
    """The cost along a direction, and its derivative in the direction."""
    source, source_weights, target, target_weights = tensors
    rows, columns, masses = monotone_plans((source @ line)[None], source_weights, (target @ line)[None], target_weights)
    between = source[rows[0]] - target[columns[0]]
    gaps = between @ line
    sizes = gaps.abs() ** (p - 1) * masses[0]
    return (sizes * gaps.abs()).sum(), p * (sizes * gaps.sign()) @ between


# Weighted slices.


@public_loss
def energy_sliced_wasserstein(
    source: MeasuresLike,
    target: MeasuresLike,
    directions: Directions = 100,
    p: float = 2,
    power: float = 1.0,
    temperature: float | None = None,
    *,
    seed: Generator = 0,
    reduction: str = "none",
) -> Float[Tensor, "*B"]:
    r"""The energy-based sliced Wasserstein loss: directions of larger cost have a larger weight.

    .. math::

        \sum_{l=1}^{L} w_l \, C_l, \qquad w_l = \frac{f(C_l)}{\sum_k f(C_k)}, \qquad
        C_l = \W_p^p(\theta_l^* \mu, \theta_l^* \nu)

    The energy f is a power, :math:`f(c) = c^a`, or an exponential, :math:`f(c) = \exp(c/T^p)`. The value lies between
    the sliced and the max-sliced loss on the same directions: the first for a = 0, the second for a → ∞ or T → 0.

    Parameters
    ----------
    source, target : measure of points, Mesh, Contour, array or tensor, or a batch of them
        An (n, d) array or tensor means points of equal weight, a mesh the barycentres of its faces, weighted by area.
    directions, seed, reduction
        As :func:`meshot.sliced_wasserstein`. Uniform directions make it the estimate by importance sampling.
    p : float
        The exponent of the transport cost, at least 1.
    power : float
        The exponent a of the energy: 0, or at least 1. A pure number.
    temperature : float, optional
        The length T, in the units of the points. With it the energy is exponential, and ``power`` is not used. The
        paper has T = 1 in whatever unit the points have.

    Returns
    -------
    tensor
        In (units of the points)^p. The gradient includes that of the weights.

    Raises
    ------
    ValueError
        If an argument does not fit, or the value exceeds the range of the dtype.

    Notes
    -----
    The costs are computed by the kernels of :func:`meshot.sliced_wasserstein`, twice if a gradient is needed. The
    factor of the gradient of C_l is w_l (1 + (C_l − v) f′(C_l)/f(C_l)), where v is the value. Where it is negative, a
    descent makes the cost along this direction larger.

    References
    ----------
    Nguyen and Ho, *Energy-Based Sliced Wasserstein Distance*, NeurIPS 2023.

    Examples
    --------
    >>> import numpy as np
    >>> from meshot.loss import energy_sliced_wasserstein
    >>> points = np.random.default_rng(0).normal(size=(50, 2))
    >>> moved = points + np.array([2.0, 0.0])  # along an angle φ the cost is 4 cos² φ
    >>> [round(float(energy_sliced_wasserstein(points, moved, power=a)), 3) for a in (0, 1, 100)]
    [2.0, 3.0, 3.98]
    """
    pairs = as_pairs(source, target, of_points=True, reduction=reduction)
    lines = checked_lines(pairs.like, directions, p, seed)
    if temperature is not None:
        require_positive(temperature, "temperature", "the units of the points")
    elif not (power == 0 or 1 <= power < math.inf):
        raise ValueError(f"power is {power!r}; 0 or a finite number >= 1 is needed (between, the gradient is infinite)")
    values = []
    for pair in pairs.items:
        costs = line_costs(*pair, lines, p)
        if temperature is not None:
            weights = torch.softmax(costs / temperature**p, dim=0)
        else:
            top = costs.detach().max()
            energies = (costs / torch.where(top > 0, top, 1)) ** power if power else torch.ones_like(costs)
            total = energies.sum()
            weights = energies / torch.where(total > 0, total, 1)
        values.append(_in_range((weights * costs).sum()))
    return pairs.reduced(values)


# Corrected slices.

#: The control variates: functions of a direction whose mean over the sphere is known.
CONTROLS = ("quadratic", "lower", "upper")


@public_loss
def controlled_sliced_wasserstein(
    source: MeasuresLike,
    target: MeasuresLike,
    directions: Directions = 100,
    p: float = 2,
    control: str = "quadratic",
    *,
    seed: Generator = 0,
    reduction: str = "none",
) -> Float[Tensor, "*B"]:
    r"""The sliced Wasserstein loss with control variates, an estimate of the same SW_p^p with a smaller variance.

    .. math::

        \frac1L \sum_{l=1}^{L} \bigl( C(\theta_l) - \hat\beta^\top \bigl( q(\theta_l) - \mathbb{E}\, q \bigr) \bigr)

    The functions q have a known mean over the sphere. Their coefficients are fitted by least squares to the costs along
    the same directions.

    Parameters
    ----------
    source, target : measure of points, Mesh, Contour, array or tensor, or a batch of them
        An (n, d) array or tensor means points of equal weight, a mesh the barycentres of its faces, weighted by area.
    directions, seed, reduction
        As :func:`meshot.sliced_wasserstein`. The method is for independent directions. Even sets leave less to correct.
    p : float
        The exponent, at least 1; 2 for ``"lower"`` and ``"upper"``.
    control : str
        ``"quadratic"``: all products of two coordinates of the direction, d(d + 1)/2 − 1 coefficients. ``"lower"``: the
        squared difference of the projected means, a lower bound of the cost. ``"upper"``: this plus the variances of
        both projections, an upper bound. Both have one coefficient, and are quadratic forms themselves.

    Returns
    -------
    tensor
        In (units of the points)^p. Because coefficients are fitted, it has a bias of order 1/L, and it may be negative.

    Raises
    ------
    ValueError
        If an argument does not fit, or there are fewer than twice as many directions as coefficients and one.

    References
    ----------
    Nguyen and Ho, *Sliced Wasserstein Estimation with Control Variates*, ICLR 2024, for the lower and upper bound;
    Leluc et al., *Sliced-Wasserstein Estimation with Spherical Harmonics as Control Variates*, ICML 2024, of whose
    functions the quadratic ones are those of degree 2.

    Examples
    --------
    >>> import numpy as np, meshot
    >>> from meshot.loss import controlled_sliced_wasserstein
    >>> points = np.random.default_rng(0).normal(size=(50, 3))
    >>> lines = meshot.random_directions(20, 3, 0)
    >>> round(float(controlled_sliced_wasserstein(points, points + 1, lines)), 6)  # a translation: |t|²/d, exactly
    1.0
    """
    pairs = as_pairs(source, target, of_points=True, reduction=reduction)
    lines = checked_lines(pairs.like, directions, p, seed)
    require_choice(control, "control", CONTROLS)
    n, d = lines.shape
    n_fitted = d * (d + 1) // 2 - 1 if control == "quadratic" else 1
    if control != "quadratic" and p != 2:
        raise ValueError(f"p is {p!r} beside control {control!r}, which is for p = 2: take 'quadratic'")
    if n < 2 * (n_fitted + 1):
        raise ValueError(
            f"{n} directions are too few for {n_fitted} coefficients in R^{d}; {2 * (n_fitted + 1)} are needed"
        )
    values = []
    for one, other in pairs.items:
        costs = line_costs(one, other, lines, p)
        if control == "quadratic":
            columns = quadratic_controls(lines)
        else:
            columns = bound_control(one, other, lines, control)[:, None]
        values.append(_in_range(without_controls(costs, columns)))
    return pairs.reduced(values)


def quadratic_controls(directions: Float[Tensor, "L d"]) -> Float[Tensor, "L k"]:
    """All products θᵢθⱼ minus their means over the sphere, without the last square (the squares sum to one)."""
    d = directions.shape[1]
    rows, columns = torch.triu_indices(d, d, device=directions.device)
    products = directions[:, rows] * directions[:, columns] - (rows == columns).to(directions) / d
    return products[:, :-1]


def bound_control(
    source: Measure, target: Measure, directions: Float[Tensor, "L d"], control: str = "lower"
) -> Float[Tensor, " L"]:
    """A bound of the cost W₂² along every direction, minus its mean over the sphere."""
    # Below: the squared difference of the means. Above: the cost of independent partners, which adds both variances.
    d = directions.shape[1]
    (mean, covariance), (other, its_covariance) = (_moments(measure) for measure in (source, target))
    shift = mean - other
    bound = (directions @ shift) ** 2 - shift @ shift / d
    if control == "upper":
        both = covariance + its_covariance
        bound = bound + ((directions @ both) * directions).sum(dim=1) - both.trace() / d
    return bound


def _moments(measure: Measure) -> tuple[Float[Tensor, " d"], Float[Tensor, "d d"]]:
    mean = measure.weights @ measure.places
    centred = measure.places - mean
    return mean, (centred * measure.weights[:, None]).T @ centred


def without_controls(costs: Float[Tensor, " L"], columns: Float[Tensor, "L k"]) -> Float[Tensor, ""]:
    """The mean cost minus what a least-squares fit explains by functions of mean zero: the intercept of the fit."""
    if columns.shape[1] == 1:
        column = columns[:, 0] - columns.mean()
        spread = column.square().sum()
        # Equal means leave a column of rounding errors, to which nothing is fitted.
        if bool(spread <= 1e-20 * costs.square().sum()):
            return costs.mean()
        return costs.mean() - column @ costs / spread * columns.mean()
    # The intercept is a sum of the costs with factors that depend on the directions only.
    design = torch.cat([torch.ones_like(columns[:, :1]), columns], dim=1)
    return torch.linalg.pinv(design)[0] @ costs


# Slices that lift to a plan between the points of space.

_ROOM = 1 << 22  # coordinates of differences per chunk of directions
#: Rows, columns and masses: mass k goes from point ``rows[k]`` of the source to point ``columns[k]`` of the target.
Plan = tuple[Int64[Tensor, " k"], Int64[Tensor, " k"], Float[Tensor, " k"]]


@public_loss
def min_sliced_transport(
    source: MeasuresLike,
    target: MeasuresLike,
    directions: Directions = 100,
    p: float = 2,
    *,
    seed: Generator = 0,
    reduction: str = "none",
) -> Float[Tensor, "*B"]:
    r"""The smallest cost, in space, of a plan that a direction gives (min-SWGG, min-pivot sliced transport).

    .. math::

        \min_{l} \sum_{ij} \pi^{\theta_l}_{ij} \lVert x_i - y_j \rVert^p

    Along a direction θ the monotone plan pairs the points by rank. The same plan moves the points of space, at a
    cost of at least W_p^p. The smallest over the directions is therefore an upper bound of W_p^p. It is exact for
    translations and dilations, on a line, and if all points of one measure lie on a line of the set.

    Parameters
    ----------
    source, target : measure of points, Mesh, Contour, array or tensor, or a batch of them
        Any numbers of points, any weights. An (n, d) array or tensor means points of equal weight, a mesh the
        barycentres of its faces, weighted by area.
    directions, seed, reduction
        As :func:`meshot.sliced_wasserstein`.
    p : float
        The exponent, at least 1.

    Returns
    -------
    tensor
        In (units of the points)^p. In the gradient the plan is constant, which is exact where it is unique.

    Raises
    ------
    ValueError
        If an argument does not fit, or the value exceeds the range of the dtype.

    Notes
    -----
    O(L (n + m)(d + log(n + m))) time. Points with the same projection are ordered arbitrarily.

    References
    ----------
    Mahey et al., *Fast Optimal Transport through Sliced Generalized Wasserstein Geodesics*, NeurIPS 2023; Tanguy,
    Chapel and Delon, *Sliced Optimal Transport Plans*, 2025. In POT: ``ot.sliced.min_sliced_transport_plan``.

    Examples
    --------
    >>> import numpy as np
    >>> from meshot.loss import min_sliced_transport
    >>> points = np.random.default_rng(0).normal(size=(50, 3))
    >>> round(float(min_sliced_transport(points, points + np.array([3.0, 0, 4.0]), 5)), 6)
    25.0
    """
    pairs = as_pairs(source, target, of_points=True, reduction=reduction)
    lines = checked_lines(pairs.like, directions, p, seed)
    return pairs.reduced([_plan_cost(*pair, _best_plan(*pair, lines, p), p) for pair in pairs.items])


@public_loss
def min_sliced_plan(
    source: MeasuresLike, target: MeasuresLike, directions: Directions = 100, p: float = 2, *, seed: Generator = 0
) -> Plan:
    """The transport plan whose cost is :func:`meshot.loss.min_sliced_transport`, between two measures of points.

    Returns
    -------
    rows, columns, masses : tensors
        Mass k goes from point ``rows[k]`` of the source to point ``columns[k]`` of the target: n of them between
        equally many points of equal mass, n + m otherwise, of which some are zero.

    Raises
    ------
    ValueError
        If an argument does not fit, or is a batch.

    Examples
    --------
    >>> import numpy as np
    >>> from meshot.loss import min_sliced_plan
    >>> points = np.array([[0.0, 0.0], [1.0, 0.5], [2.0, 3.0]])
    >>> rows, columns, masses = min_sliced_plan(points, points[::-1] + 5, 3)
    >>> sorted(zip(rows.tolist(), columns.tolist()))
    [(0, 2), (1, 1), (2, 0)]
    """
    pairs = as_pairs(source, target, of_points=True)
    if pairs.batched:
        raise ValueError(f"a batch of {len(pairs.items)} pairs came; a plan is between two measures: take them in turn")
    return _best_plan(*pairs.items[0], checked_lines(pairs.like, directions, p, seed), p)


def _best_plan(source: Measure, target: Measure, lines: Float[Tensor, "L d"], p: float) -> Plan:
    """The cheapest of the plans along the directions. Its masses are differentiable in the weights."""
    n_places = (len(source.places) + len(target.places)) * lines.shape[1]
    costs = []
    with torch.no_grad():
        for chunk in lines.split(max(1, _ROOM // n_places)):
            rows, columns, masses = _plans_along(source, target, chunk)
            gaps = source.places[rows] - target.places[columns]
            costs.append((masses * _ground_cost(gaps, p)).sum(dim=1))
        best = lines[int(torch.cat(costs).argmin())]
    rows, columns, masses = _plans_along(source, target, best[None])
    return rows[0], columns[0], masses[0]


def _plans_along(source: Measure, target: Measure, lines: Float[Tensor, "L d"]) -> tuple[Tensor, Tensor, Tensor]:
    projected = (lines @ measure.places.detach().T for measure in (source, target))
    return monotone_plans(next(projected), source.weights, next(projected), target.weights)


def monotone_plans(
    source: Float[Tensor, "L n"],
    source_weights: Float[Tensor, " n"],
    target: Float[Tensor, "L m"],
    target_weights: Float[Tensor, " m"],
) -> tuple[Int64[Tensor, "L k"], Int64[Tensor, "L k"], Float[Tensor, "L k"]]:
    """The monotone plan between weighted points on a line, for every row: rows, columns and masses."""
    source_order, target_order = row_order(source), row_order(target)
    if same_equal_masses(source_weights, target_weights):
        return source_order, target_order, source_weights.expand(len(source), -1)
    # The jumps of both quantile functions divide [0, 1] into n + m cells, as in meshot.loss.quantile_cost.
    ends = torch.cat([source_weights[source_order].cumsum(dim=1), target_weights[target_order].cumsum(dim=1)], dim=1)
    order = row_order(ends, "stable")
    cell_ends = ends.gather(1, order)
    of_source = (order < source.shape[1]).long()
    ended = of_source.cumsum(dim=1) - of_source
    rows = source_order.gather(1, ended.clamp(max=source.shape[1] - 1))
    ended = torch.arange(ends.shape[1], device=ends.device) - ended
    columns = target_order.gather(1, ended.clamp(max=target.shape[1] - 1))
    return rows, columns, torch.diff(cell_ends, dim=1, prepend=torch.zeros_like(cell_ends[:, :1]))


def _plan_cost(source: Measure, target: Measure, plan: Plan, p: float) -> Float[Tensor, ""]:
    rows, columns, masses = plan
    return _in_range((masses * _ground_cost(source.places[rows] - target.places[columns], p)).sum())


def _ground_cost(gaps: Float[Tensor, "*k d"], p: float) -> Float[Tensor, "*k"]:
    """The Euclidean length to the power p, with finite gradients at zero."""
    return gaps.square().sum(dim=-1) if p == 2 else torch.linalg.vector_norm(gaps, dim=-1) ** p


# Plans along a space-filling curve.

_BITS = 52  # of an index on the curve, which is then exact as a float


@public_loss
def hilbert_transport(
    source: MeasuresLike,
    target: MeasuresLike,
    n_curves: int = 1,
    p: float = 2,
    *,
    seed: Generator = 0,
    reduction: str = "none",
) -> Float[Tensor, "*B"]:
    r"""The cost, in space, of the plan that pairs points by their order along a Hilbert curve (HCP).

    Both measures lie in one cube, which a Hilbert curve fills. Neighbours on the curve are neighbours in space. The
    monotone plan along the curve moves the points of space, at a cost of at least W_p^p.

    Parameters
    ----------
    source, target, seed, reduction
        As :func:`meshot.loss.min_sliced_transport`. The seed is that of the turns.
    n_curves : int
        The cube is turned at random, so that its walls lie elsewhere. The value is the mean over this number of turns.
    p : float
        The exponent, at least 1.

    Returns
    -------
    tensor
        In (units of the points)^p, an upper bound of W_p^p. In the gradient the plans are constant.

    Raises
    ------
    ValueError
        If an argument does not fit, or the value exceeds the range of the dtype.

    Notes
    -----
    O(n log n) time for each curve. The curve has :math:`2^b` cells along each side of the cube, where b is 20, or 52/d
    if this is less. Points in one cell are ordered arbitrarily. In the reference the cube is not turned.

    References
    ----------
    Li, Meng, Xu and Yu, *Hilbert Curve Projection Distance for Distribution Comparison*, IEEE Transactions on Pattern
    Analysis and Machine Intelligence, 2024. The index on the curve: Skilling, *Programming the Hilbert curve*, 2004.

    Examples
    --------
    >>> import numpy as np, meshot
    >>> from meshot.loss import hilbert_transport
    >>> x, y = np.random.default_rng(0).uniform(size=(2, 500, 3))
    >>> float(meshot.wasserstein(x, y)) < float(hilbert_transport(x, y)) < 0.2  # independent partners: 0.5
    True
    """
    pairs = as_pairs(source, target, of_points=True, reduction=reduction)
    require_exponent(p)
    n_curves = require_positive_integer(n_curves, "n_curves")
    if pairs.like.shape[1] > _BITS:
        raise ValueError(
            f"the points are in R^{pairs.like.shape[1]}; at most R^{_BITS} is possible: reduce it, or slice"
        )
    turns = _turns(n_curves, pairs.like.shape[1], drawn_seed(seed))
    values = []
    for one, other in pairs.items:
        plans = [_curve_plan(one, other, turn) for turn in turns]
        values.append(torch.stack([_plan_cost(one, other, plan, p) for plan in plans]).mean())
    return pairs.reduced(values)


def _turns(n: int, d: int, seed: int) -> Float[Array, "n d d"]:
    gaussian = numpy_generator(seed).standard_normal((n, d, d))
    return np.linalg.qr(gaussian)[0]


def _curve_plan(source: Measure, target: Measure, turn: Float[Array, "d d"]) -> Plan:
    """The monotone plan along the Hilbert curve in the cube around both measures."""
    sides = [measure.places.detach().double().cpu().numpy() @ turn for measure in (source, target)]
    # Points without mass change nothing: they may lie outside the cube.
    massive = np.concatenate([side[m.weights.detach().cpu().numpy() > 0] for side, m in zip(sides, (source, target))])
    low = massive.min(axis=0)
    extent = float((massive - low).max())
    bits = min(20, _BITS // len(low))
    scale = (2**bits - 1) / extent if 0 < extent < math.inf else 0.0
    cells = (np.clip((side - low) * scale, 0, 2**bits - 1).astype(np.int64) for side in sides)
    indices = (hilbert_index(each, bits) for each in cells)
    rows, other = (torch.from_numpy(each.astype(np.float64)).to(source.weights.device)[None] for each in indices)
    rows, columns, masses = monotone_plans(rows, source.weights, other, target.weights)
    return rows[0], columns[0], masses[0]


def hilbert_index(cells: Int64[Array, "n d"], n_bits: int) -> Int64[Array, " n"]:
    """The position on the Hilbert curve of each cell of a grid of 2^n_bits cells a side."""
    # Skilling's algorithm: undo the turns of the subcubes from the largest to the smallest, then a Gray code.
    axes, d = [column.copy() for column in cells.T], cells.shape[1]
    for bit in range(n_bits - 1, 0, -1):
        low = (1 << bit) - 1
        for k in range(d):
            beyond = (axes[k] >> bit & 1).astype(bool)
            swapped = np.where(beyond, 0, (axes[0] ^ axes[k]) & low)
            axes[0] ^= np.where(beyond, low, swapped)
            axes[k] ^= swapped
    for before, after in itertools.pairwise(axes):
        after ^= before
    flips = np.zeros(len(cells), np.int64)
    for bit in range(n_bits - 1, 0, -1):
        flips ^= np.where(axes[-1] >> bit & 1, (1 << bit) - 1, 0)
    digits = ((axis ^ flips) >> bit & 1 for bit in range(n_bits - 1, -1, -1) for axis in axes)
    return functools.reduce(lambda index, digit: index << 1 | digit, digits)
