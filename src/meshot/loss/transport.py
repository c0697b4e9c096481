"""Losses between all points of two measures: exact transport, the Sinkhorn divergence, and Chamfer."""

import importlib.util
import math
import warnings

import torch
from scipy.spatial import cKDTree

from meshot.errors import require_choice, require_positive
from meshot.loss.autograd import differentiable_once, public_loss
from meshot.measure import Measure, MeasuresLike, as_pairs
from meshot.types import Float, Int64, Tensor


@public_loss
def wasserstein(
    source: MeasuresLike,
    target: MeasuresLike,
    p: float = 2,
    max_iterations: int = 10_000_000,
    *,
    reduction: str = "none",
) -> Float[Tensor, "*B"]:
    r"""The Wasserstein distance W_p^p with ground cost ‖x − y‖₂^p, exactly, by linear programming.

    .. math::

        \min_{P \ge 0} \; \sum_{ij} P_{ij} \, \lVert x_i - y_j \rVert_2^p
        \quad \text{such that} \quad P 1 = a, \; P^\top 1 = b

    Here P is a plan between the masses a and b. The value is differentiable. For the points the optimal plan is treated
    as constant (envelope theorem). The gradient in the weights is given by the dual potentials, up to a constant. The
    paper writes ‖x − y‖_p^p; for p = 2 both costs are equal.

    Parameters
    ----------
    source, target : measure of points, Mesh, Contour, array or tensor, or a batch of them
        Any numbers of support points, any weights. An (n, d) array or tensor means points of equal weight. A mesh means
        the barycentres of its faces, weighted by area (to draw points on it, use :func:`meshot.empirical`).
    p : float
        The exponent, at least 1.
    max_iterations : int
        Maximum number of iterations of the solver.
    reduction : str
        Of a batch: "none" for a value per pair, "mean" for their mean.

    Returns
    -------
    tensor
        W_p^p, in (units of the points)^p. The p-th root is a distance. A scalar, or (B,) for a batch.

    Raises
    ------
    ValueError
        If an argument is not a measure of points, the measures are in different spaces, ``p`` is not a finite number
        >= 1, the solver does not converge, or the cost exceeds the range of the dtype.

    Notes
    -----
    About O(n³ log n) time and O(n²) memory: suitable for up to about 5 000 support points. The tolerance of the solver
    is absolute. The points are therefore scaled by a power of two to a size of about 1, and the value is scaled back.

    References
    ----------
    Bonneel et al., *Displacement Interpolation Using Lagrangian Mass Transport*, 2011 (the solver in POT).

    Examples
    --------
    >>> import numpy as np, meshot
    >>> float(meshot.wasserstein(np.array([[0.0, 0.0]]), np.array([[3.0, 4.0]])))
    25.0
    """
    pairs = as_pairs(source, target, of_points=True, reduction=reduction)
    if not 1 <= p < math.inf:
        raise ValueError(f"p is {p!r}; a finite number >= 1 is needed")
    return pairs.reduced([_exact_cost(*pair, p, max_iterations) for pair in pairs.items])


def _exact_cost(source: Measure, target: Measure, p: float, max_iterations: int) -> Float[Tensor, ""]:
    """W_p^p of one pair."""
    # From differences: |x|² + |y|² − 2⟨x, y⟩ would suffer from cancellation for close points.
    gaps = source.places[:, None, :] - target.places[None, :, :]
    size = float(gaps.detach()[source.weights > 0][:, target.weights > 0].abs().max())
    unit = math.ldexp(1.0, math.frexp(size)[1] - 1) if 0 < size < math.inf else 1.0
    squared = (gaps / unit).square().sum(dim=2)
    cost = squared if p == 2 else torch.where(squared > 0, squared, torch.ones_like(squared)).pow(p / 2) * (squared > 0)
    import ot  # here: it takes seconds, for which nobody waits who calls something else

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        # POT refuses arrays with gaps in memory.
        masses = (differentiable_once(measure.weights.contiguous()) for measure in (source, target))
        value = ot.emd2(*masses, cost.contiguous(), numItermax=max_iterations)
    if caught:
        raise ValueError(
            f"the transport solver did not finish ({caught[0].message}): raise max_iterations or use fewer points"
        )
    value = value * unit**p if p * math.log2(unit) < 1024 else value * math.inf
    if not math.isfinite(float(value.detach())):
        raise ValueError(
            f"W_p^p exceeds {value.dtype} at p = {p:g} for points {unit:.3g} apart: scale both measures down"
        )
    return value


# Entropy-regularised transport, debiased, computed by GeomLoss.

#: GeomLoss's methods for sums over pairs of points. All but the first need KeOps.
BACKENDS = ("tensorized", "online", "multiscale")

#: Measures of a smaller extent, in blurs, are a point to the loss.
POINT = 1e-6


@public_loss
def sinkhorn_divergence(
    source: MeasuresLike,
    target: MeasuresLike,
    p: int = 2,
    blur: float = 0.05,
    scaling: float = 0.5,
    reach: float | None = None,
    backend: str = "tensorized",
    *,
    reduction: str = "none",
) -> Float[Tensor, "*B"]:
    r"""The debiased Sinkhorn divergence with ground cost ‖x − y‖₂^p. It approximates W_p^p for a small blur.

    .. math::

        \mathrm{OT}_\varepsilon(\mu, \nu) - \tfrac12 \mathrm{OT}_\varepsilon(\mu, \mu)
        - \tfrac12 \mathrm{OT}_\varepsilon(\nu, \nu)

    Each term is the cost of entropic transport, and ε is the p-th power of ``blur``. GeomLoss divides the cost by p.
    This is undone here, so that the value is comparable with :func:`meshot.wasserstein`. ``blur``, ``scaling``,
    ``reach`` and ``backend`` have the same meaning as in GeomLoss.

    Parameters
    ----------
    source, target : measure of points, Mesh, Contour, array or tensor, or a batch of them
        Any numbers of support points, any weights. An (n, d) array or tensor means points of equal weight. A mesh means
        the barycentres of its faces, weighted by area (to draw points on it, use :func:`meshot.empirical`).
    p : int
        1 or 2.
    blur : float
        The length below which details are smoothed, in units of the points: .05 is 5 % of the side of a unit cube, but
        .05 mm in a scan. Larger values are faster and smoother.
    scaling : float
        In (0, 1): the factor per step by which the blur decreases from the diameter. Values closer to one are slower
        and more accurate.
    reach : float, optional
        Makes transport unbalanced: the distance, in units of the points, beyond which mass is left unmatched instead of
        transported. By default all mass is transported.
    backend : str
        ``"tensorized"`` stores all pairs of points, for up to about 5000 support points. ``"online"`` recomputes them,
        with memory O(n + m). ``"multiscale"`` does so from coarse to fine, in up to three dimensions; for p = 2 it is
        the fastest above about 20 000 support points. Both need KeOps: ``pip install pykeops``.
    reduction : str
        Of a batch: "none" for a value per pair, "mean" for their mean.

    Returns
    -------
    tensor
        In (units of the points)^p. It is zero between equal measures, and non-negative if ``scaling`` is close enough
        to one. At .5 the errors of the three terms may differ, and the value may be tens of per cent too low, or
        negative (chapter 4 shows a case). Neither the value nor a root of it is a metric.

    Raises
    ------
    ValueError
        If an argument is not a measure of points, the measures are in different spaces, a parameter is outside its
        range, or the backend needs KeOps and KeOps is not installed.

    Notes
    -----
    O(n m) time per iteration, and with the first backend O(n m) memory.

    References
    ----------
    Feydy et al., *Interpolating between Optimal Transport and MMD using Sinkhorn Divergences*, AISTATS 2019; Séjourné
    et al., *Sinkhorn Divergences for Unbalanced Optimal Transport*, 2019.

    Examples
    --------
    >>> import numpy as np, meshot
    >>> round(float(meshot.sinkhorn_divergence(np.array([[0.0, 0.0]]), np.array([[3.0, 4.0]]), blur=0.1)), 4)
    25.0
    """
    pairs = as_pairs(source, target, of_points=True, reduction=reduction)
    if p not in (1, 2):
        raise ValueError(f"p is {p!r}; 1 or 2 is needed, the costs that GeomLoss has")
    for name, length in (("blur", blur), *((("reach", reach),) if reach is not None else ())):
        require_positive(length, name, "units of the points")
    if not 0 < scaling < 1:
        raise ValueError(f"scaling is {scaling!r}; a number in (0, 1) is needed")
    require_choice(backend, "backend", BACKENDS)
    if backend != "tensorized" and importlib.util.find_spec("pykeops") is None:
        raise ValueError(f"backend {backend!r} needs KeOps, which is not installed: pip install pykeops")
    options = {"blur": blur, "scaling": scaling, "reach": reach, "backend": backend}
    return pairs.reduced([_debiased_cost(*pair, p, options) for pair in pairs.items])


def _debiased_cost(source: Measure, target: Measure, p: int, options: dict) -> Float[Tensor, ""]:
    """The divergence of one pair."""
    import geomloss

    sides = [(measure.weights, measure.places, measure.weights > 0) for measure in (source, target)]
    places = torch.cat([places[massive] for _, places, massive in sides]).detach()
    extent = float((places.amax(dim=0) - places.amin(dim=0)).norm())
    # Annealing begins at the diameter; from one point it would begin at zero, and divide by it. Points without mass do
    # not count.
    diameter = options["blur"] if extent < POINT * options["blur"] else None
    if diameter is None and not all(bool(massive.all()) for *_, massive in sides):
        diameter = extent
    loss = geomloss.SamplesLoss("sinkhorn", p=p, debias=True, diameter=diameter, **options)
    # GeomLoss holds the potentials constant in its gradient, so that a derivative of the gradient would be wrong.
    return p * loss(*(differentiable_once(tensor) for weights, places, _ in sides for tensor in (weights, places)))


# The Chamfer loss: squared distances to nearest neighbours.

#: Methods of finding nearest neighbours. All give the same value.
NEIGHBOURS = ("tree", "brute")
_BLOCK = 1 << 23  # distances per block of brute force: large enough that the memory is returned to the system


@public_loss
def chamfer(
    source: MeasuresLike, target: MeasuresLike, neighbours: str = "tree", *, reduction: str = "none"
) -> Float[Tensor, "*B"]:
    r"""The Chamfer pseudo-distance: the mean squared distance to the nearest neighbour, summed over both directions.

    .. math::

        \sum_i a_i \min_j \lVert x_i - y_j \rVert^2 + \sum_j b_j \min_i \lVert x_i - y_j \rVert^2

    With equal weights this is Equation 1 of the paper. Otherwise the means are weighted. Points without mass are no
    neighbours; how much mass a neighbour has does not matter. The nearest neighbours are
    treated as constant in the gradient, which is exact where they are unique.

    Parameters
    ----------
    source, target : measure of points, Mesh, Contour, array or tensor, or a batch of them
        Any numbers of support points, any weights. An (n, d) array or tensor means points of equal weight. A mesh means
        the barycentres of its faces, weighted by area (to draw points on it, use :func:`meshot.empirical`).
    neighbours : str
        "tree" for a k-d tree on the CPU; "brute" for all distances, in blocks, on the device of the points.
    reduction : str
        Of a batch: "none" for a value per pair, "mean" for their mean.

    Returns
    -------
    tensor
        In squared units of the points. A scalar, or (B,) for a batch.

    Raises
    ------
    ValueError
        If an argument is not a measure of points, the measures are in different spaces, ``neighbours`` is unknown, or
        squared distances exceed the range of the dtype.

    Notes
    -----
    The Chamfer loss is symmetric and non-negative. It violates the triangle inequality, and it is zero between
    different measures with equal supports. Expected time O((n + m) log(n + m)) with a tree in low dimension, and O(n m)
    by brute force. Memory O(n + m) in both cases.

    References
    ----------
    Barrow et al., IJCAI 1977; Le et al., ICLR 2024, Equation 1.

    Examples
    --------
    >>> import numpy as np, meshot
    >>> float(meshot.chamfer(np.array([[0.0, 0.0]]), np.array([[3.0, 4.0]])))  # 5² there, 5² back
    50.0
    """
    pairs = as_pairs(source, target, of_points=True, reduction=reduction)
    return pairs.reduced([_chamfer(*pair, neighbours) for pair in pairs.items])


def _chamfer(source: Measure, target: Measure, neighbours: str) -> Float[Tensor, ""]:
    """The loss of one pair."""
    (x, a), (y, b) = (_support(measure) for measure in (source, target))
    forward = (x - y[nearest_neighbours(x, y, neighbours)]).square().sum(dim=1)
    backward = (y - x[nearest_neighbours(y, x, neighbours)]).square().sum(dim=1)
    return (a * forward).sum() + (b * backward).sum()


def _support(measure: Measure) -> tuple[Tensor, Tensor]:
    """The points that have mass, and their masses."""
    massive = measure.weights > 0
    if bool(massive.all()):
        return measure.places, measure.weights
    return measure.places[massive], measure.weights[massive]


def nearest_neighbours(
    points: Float[Tensor, "n d"], candidates: Float[Tensor, "m d"], method: str = "tree"
) -> Int64[Tensor, " n"]:
    """The index of the nearest candidate of every point, in the Euclidean norm.

    Raises
    ------
    ValueError
        If ``method`` is neither "tree" nor "brute", or squared distances exceed the range of the dtype.
    """
    require_choice(method, "neighbours", NEIGHBOURS)
    points, candidates = points.detach(), candidates.detach()
    size = max(float(points.abs().max()), float(candidates.abs().max()))
    if not 4 * points.shape[1] * size * size <= torch.finfo(points.dtype).max:
        raise ValueError(f"coordinates reach {size:.3g}, and squared distances exceed {points.dtype}: scale both down")
    if method == "brute":
        blocks = points.split(max(1, _BLOCK // len(candidates)))
        # From differences: |x|² + |y|² − 2⟨x, y⟩ would suffer from cancellation and could give a wrong neighbour.
        mode = "donot_use_mm_for_euclid_dist"
        return torch.cat([torch.cdist(block, candidates, compute_mode=mode).argmin(dim=1) for block in blocks])
    tree = cKDTree(candidates.cpu().numpy())
    _, index = tree.query(points.cpu().numpy(), workers=torch.get_num_threads())
    return torch.from_numpy(index).to(points.device, torch.int64)
