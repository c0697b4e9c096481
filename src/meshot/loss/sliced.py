"""The sliced Wasserstein loss: 1D transport costs averaged over directions."""

import torch

from meshot.loss.chunked import chunked_costs, chunked_sliced_wasserstein
from meshot.loss.directions import Directions
from meshot.loss.exact import exact_slice_costs, exact_sliced_wasserstein
from meshot.loss.fused import fused_slices, mean_of_slices, takes_kernel
from meshot.loss.plain import checked_lines, plain_costs
from meshot.measure import MeasureLike, as_measures
from meshot.types import Float, Tensor


def sliced_wasserstein(
    source: MeasureLike,
    target: MeasureLike,
    directions: Directions = 100,
    p: float = 2,
) -> Float[Tensor, ""]:
    r"""The Monte Carlo sliced Wasserstein loss SW_p^p: the mean over directions of the 1D transport cost W_p^p.

    .. math::

        \frac{1}{L} \sum_{l=1}^{L} \W_p^p(\theta_l^* \mu, \theta_l^* \nu), \qquad
        \W_p^p(\theta^* \mu, \theta^* \nu) = \int_0^1 |F_\theta^{-1}(z) - G_\theta^{-1}(z)|^p \, dz

    Both measures are projected on the same directions. Along each direction optimal transport is monotone, so its cost
    is an integral over the quantile functions of the two projections. The loss is differentiable with respect to points
    and weights. The gradient in the weights is a Kantorovich potential, defined up to a constant.

    Parameters
    ----------
    source, target : measure, Mesh, Contour, array or tensor
        Any numbers of support points, any weights; also one of each kind. A mesh means its continuous measure,
        :func:`meshot.surface`. An (n, d) array or tensor means points of equal weight. With a continuous measure the
        cost along every direction is exact, without sampling: see ``meshot.loss.exact``.
    directions : tensor, array or int
        Unit rows, such as those of :func:`meshot.random_directions`; or the number of directions in the deterministic
        set :func:`meshot.quasi_directions` with seed 0.
    p : float
        The exponent, at least 1; 1 or 2 with a continuous measure.

    Returns
    -------
    tensor
        SW_p^p, in (units of the points)^p. The p-th root is a distance.

    Raises
    ------
    ValueError
        If an argument is not a measure, the measures are in different spaces, the directions do not fit, ``p`` < 1, or
        p is neither 1 nor 2 and a measure is continuous.

    Notes
    -----
    On a CPU, a compiled kernel processes the directions on ``torch.get_num_threads()`` threads: O(L (n + m)) time for
    spread-out points, and memory for a limited group of directions per thread. The result is the same in every run with
    the same number of threads. Only first derivatives are available. On other devices PyTorch processes the directions
    in chunks, with the memory of one chunk. If the directions require a gradient,
    :func:`meshot.loss.plain_sliced_wasserstein` is used.

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
    """
    source, target = as_measures(source, target)
    if source.cells is not None or target.cells is not None:
        return exact_sliced_wasserstein(source, target, directions, p)
    directions = checked_lines(source, directions, p)
    if directions.requires_grad:
        return plain_costs(source, target, directions, p).mean()
    if not takes_kernel(source.places):
        return chunked_sliced_wasserstein(source, target, directions, p)
    tensors = (source.places, source.weights, target.places, target.weights)
    return mean_of_slices(tensors, directions, float(p))


def slice_costs(
    source: MeasureLike,
    target: MeasureLike,
    directions: Directions = 100,
    p: float = 2,
) -> Float[Tensor, " L"]:
    """The transport cost W_p^p along every direction. Its mean is :func:`meshot.sliced_wasserstein`.

    Over independent directions these costs are independent, so that the standard error of their mean is their standard
    deviation divided by √L. The arguments are those of :func:`meshot.sliced_wasserstein`.

    Returns
    -------
    tensor
        One cost per direction, in (units of the points)^p. Differentiable between discrete measures. With a continuous
        measure there is no gradient (their mean, :func:`meshot.sliced_wasserstein`, has one).

    Raises
    ------
    ValueError
        As :func:`meshot.sliced_wasserstein`.

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
    source, target = as_measures(source, target)
    if source.cells is not None or target.cells is not None:
        return exact_slice_costs(source, target, directions, p)
    directions = checked_lines(source, directions, p)
    tensors = (source.places, source.weights, target.places, target.weights, directions)
    wanted = torch.is_grad_enabled() and any(tensor.requires_grad for tensor in tensors)
    if takes_kernel(source.places) and not wanted:
        return torch.from_numpy(fused_slices(tensors[:4], directions, float(p), (False,) * 4)[0]).to(source.places)
    return (plain_costs if wanted else chunked_costs)(source, target, directions, p)
