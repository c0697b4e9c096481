"""Entropic transport, debiased, by GeomLoss."""

import importlib.util
import math

import geomloss
import torch

from meshot.measure import MeasureLike, as_point_measures
from meshot.types import Float, Tensor

#: How GeomLoss sums over pairs of points; all but the first need KeOps.
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
    """The debiased Sinkhorn divergence with ground cost ‖x − y‖₂^p: near W_p^p for a small blur.

    OT_ε(μ, ν) − ½ OT_ε(μ, μ) − ½ OT_ε(ν, ν) with ε = ``blur``^p. GeomLoss divides the cost by p; here that is undone,
    so that the value is comparable with :func:`meshot.wasserstein`; ``blur``, ``scaling``, ``reach`` and ``backend``
    keep GeomLoss's meaning.

    Parameters
    ----------
    source, target : measure of points, Mesh, Contour, array or tensor
        Any numbers of supports, any weights. An (n, d) array or tensor stands for points of equal weight, a mesh for
        the barycentres of its faces, weighted by area (:func:`meshot.empirical` draws points on it).
    p : int
        1 or 2.
    blur : float
        Below which distance details are ignored, in units of the points: .05 is 5 % of a unit cube, but .05 mm in a
        scan. Larger is faster and smoother.
    scaling : float
        In (0, 1): how fast the blur is annealed down from the diameter; nearer to one is slower and more exact.
    reach : float, optional
        Makes transport unbalanced: the distance, in units of the points, beyond which it is cheaper to leave mass
        unmatched than to move it. If left out, all mass is moved.
    backend : str
        ``"tensorized"`` holds all pairs of points, for up to some 5000 supports. ``"online"`` computes them anew, in
        memory O(n + m); ``"multiscale"`` does so from coarse to fine, in up to three dimensions and for p = 2 the
        fastest beyond some 20 000 supports. Both need KeOps: ``pip install pykeops``.

    Returns
    -------
    tensor
        In (units of the points)^p; zero between equal measures, and at least zero once ``scaling`` is near enough to
        one: at .5 the three terms may stop at different distances from their limits, and the value may come out tens
        of per cent low, or negative (chapter 04 shows a case). Not a metric, nor is a root of it.

    Raises
    ------
    ValueError
        If an argument is no measure of points, the measures live in different spaces, a parameter is outside its
        range, or the backend needs KeOps, which is not installed.

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
        if not 0 < length < math.inf:
            raise ValueError(f"{name} is {length!r}; a finite number > 0 is needed, in units of the points")
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
    if backend not in BACKENDS:
        raise ValueError(f"backend is {backend!r}; one of {', '.join(BACKENDS)} is needed")
    if backend != "tensorized" and importlib.util.find_spec("pykeops") is None:
        raise ValueError(f"backend {backend!r} needs KeOps, which is not installed: pip install pykeops")
