"""Entropy-regularised transport, debiased, computed by GeomLoss."""

import importlib.util

import geomloss
import torch

from meshot.errors import require_choice, require_positive
from meshot.measure import MeasureLike, as_point_measures
from meshot.types import Float, Tensor

#: GeomLoss's methods for sums over pairs of points. All but the first need KeOps.
BACKENDS = ("tensorized", "online", "multiscale")

#: Measures of a smaller extent, in blurs, are a point to the loss.
POINT = 1e-6


def sinkhorn_divergence(
    source: MeasureLike,
    target: MeasureLike,
    p: int = 2,
    blur: float = 0.05,
    scaling: float = 0.5,
    reach: float | None = None,
    backend: str = "tensorized",
) -> Float[Tensor, ""]:
    r"""The debiased Sinkhorn divergence with ground cost ‖x − y‖₂^p. It approximates W_p^p for a small blur.

    .. math::

        \mathrm{OT}_\varepsilon(\mu, \nu) - \tfrac12 \mathrm{OT}_\varepsilon(\mu, \mu)
        - \tfrac12 \mathrm{OT}_\varepsilon(\nu, \nu)

    Each term is the cost of entropic transport, and ε is the p-th power of ``blur``. GeomLoss divides the cost by p.
    This is undone here, so that the value is comparable with :func:`meshot.wasserstein`. ``blur``, ``scaling``,
    ``reach`` and ``backend`` have the same meaning as in GeomLoss.

    Parameters
    ----------
    source, target : measure of points, Mesh, Contour, array or tensor
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

    Returns
    -------
    tensor
        In (units of the points)^p. It is zero between equal measures, and non-negative if ``scaling`` is close enough
        to one. At .5 the errors of the three terms may differ, and the value may be tens of per cent too low, or
        negative (chapter 04 shows a case). Neither the value nor a root of it is a metric.

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
    source, target = as_point_measures(source, target)
    if p not in (1, 2):
        raise ValueError(f"p is {p!r}; 1 or 2 is needed, the costs that GeomLoss has")
    for name, length in (("blur", blur), *((("reach", reach),) if reach is not None else ())):
        require_positive(length, name, "units of the points")
    if not 0 < scaling < 1:
        raise ValueError(f"scaling is {scaling!r}; a number in (0, 1) is needed")
    _require_backend(backend)
    places = torch.cat([source.places, target.places]).detach()
    extent = float((places.amax(dim=0) - places.amin(dim=0)).norm())
    # Annealing begins at the diameter; from one point it would begin at zero, and divide by it.
    diameter = blur if extent < POINT * blur else None
    loss = geomloss.SamplesLoss(
        "sinkhorn", p=p, blur=blur, scaling=scaling, reach=reach, debias=True, backend=backend, diameter=diameter
    )  # fmt: skip
    return p * loss(source.weights, source.places, target.weights, target.places)


def _require_backend(backend: str) -> None:
    require_choice(backend, "backend", BACKENDS)
    if backend != "tensorized" and importlib.util.find_spec("pykeops") is None:
        raise ValueError(f"backend {backend!r} needs KeOps, which is not installed: pip install pykeops")
