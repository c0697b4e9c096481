"""The sliced Wasserstein loss: transport along lines, averaged over directions."""

import math

import numpy as np
import torch
from torch.autograd.function import once_differentiable

from meshot.errors import require_same_space
from meshot.loss.directions import require_directions
from meshot.loss.exact import exact_slice_costs, exact_sliced_wasserstein
from meshot.loss.fused import fused_slices
from meshot.measure import DiscreteMeasure, SurfaceMeasure
from meshot.threads import in_chunks
from meshot.types import Float, Tensor


def sliced_wasserstein(
    source: DiscreteMeasure | SurfaceMeasure,
    target: DiscreteMeasure | SurfaceMeasure,
    directions: Float[Tensor, "L d"],
    p: float = 2,
) -> Float[Tensor, ""]:
    """The Monte Carlo sliced Wasserstein loss SW_p^p: the mean over directions of the 1D transport cost W_p^p.

    Both measures are projected on the same directions. Along each one, optimal transport is monotone: the cost is
    ``∫₀¹ |F⁻¹(z) − G⁻¹(z)|^p dz`` between the two quantile functions. Differentiable in points and weights;
    the gradient in the weights is a Kantorovich potential, defined up to a constant.

    Parameters
    ----------
    source, target : DiscreteMeasure or SurfaceMeasure
        Any numbers of supports, any weights; one of each kind will do. With a continuous measure the cost along every
        direction is exact, without sampling: see ``meshot.loss.exact``.
    directions : tensor
        Unit rows; see :func:`meshot.random_directions`.
    p : float
        The exponent, at least 1; 1 or 2 with a continuous measure.

    Returns
    -------
    tensor
        SW_p^p, in (units of the points)^p; take the p-th root for a distance.

    Raises
    ------
    ValueError
        If the measures live in different spaces, the directions do not fit, ``p`` < 1, or p is neither 1 nor 2 and a
        measure is continuous.

    Notes
    -----
    On a CPU a compiled kernel takes the directions one by one on ``torch.get_num_threads()`` threads: O(L (n + m)) time
    for spread-out points, memory for one direction per thread, the same result in every run with as many threads. Its
    gradient can be taken once. Elsewhere, and where the directions need a gradient, it is
    :func:`meshot.loss.plain_sliced_wasserstein`.

    References
    ----------
    Bonneel et al., *Sliced and Radon Wasserstein Barycenters of Measures*, 2015; Le et al., ICLR 2024, Equation 5.
    """
    if isinstance(source, SurfaceMeasure) or isinstance(target, SurfaceMeasure):
        return exact_sliced_wasserstein(source, target, directions, p)
    directions = _checked_directions(source, target, directions, p)
    if _for_kernel(source.points) and not directions.requires_grad:
        return _FusedSliced.apply(
            source.points, source.weights, target.points, target.weights, directions.detach(), float(p)
        )
    return plain_sliced_wasserstein(source, target, directions, p)


def slice_costs(
    source: DiscreteMeasure | SurfaceMeasure,
    target: DiscreteMeasure | SurfaceMeasure,
    directions: Float[Tensor, "L d"],
    p: float = 2,
) -> Float[Tensor, " L"]:
    """The transport cost W_p^p along every direction, of which :func:`meshot.sliced_wasserstein` is the mean.

    What an error bar is made of: over independent directions these are independent, and the standard deviation of
    their mean is their own, divided by the root of L. Takes what :func:`meshot.sliced_wasserstein` takes.

    Returns
    -------
    tensor
        One cost for each direction, in (units of the points)^p. Differentiable between discrete measures; with a
        continuous measure these are values only, cut off from the gradient (the mean,
        :func:`meshot.sliced_wasserstein`, has one).

    Raises
    ------
    ValueError
        As :func:`meshot.sliced_wasserstein`.

    Notes
    -----
    Where a gradient is wanted it is taken in plain torch, with memory O(L (n + m)) rather than for one direction.
    """
    if isinstance(source, SurfaceMeasure) or isinstance(target, SurfaceMeasure):
        return exact_slice_costs(source, target, directions, p)
    directions = _checked_directions(source, target, directions, p)
    tensors = (source.points, source.weights, target.points, target.weights, directions)
    wanted = torch.is_grad_enabled() and any(tensor.requires_grad for tensor in tensors)
    if _for_kernel(source.points) and not wanted:
        return torch.from_numpy(fused_slices(tensors[:4], directions, p, (False,) * 4)[0]).to(source.points)
    return _plain_costs(source, target, directions, p)


def _checked_directions(source: DiscreteMeasure, target: DiscreteMeasure, directions: Tensor, p: float) -> Tensor:
    require_same_space(source.points, target.points)
    if not 1 <= p < math.inf:
        raise ValueError(f"p is {p!r}; a finite number >= 1 is needed (below one, sorting is not optimal)")
    return require_directions(directions, source.points)


def plain_sliced_wasserstein(
    source: DiscreteMeasure, target: DiscreteMeasure, directions: Float[Tensor, "L d"], p: float = 2
) -> Float[Tensor, ""]:
    """What :func:`meshot.sliced_wasserstein` computes, in plain torch: on any device, differentiable again and again.

    Notes
    -----
    O(L (n log n + m log m)) time, O(L (n + m)) memory.
    """
    return _plain_costs(source, target, directions, p).mean()


def _plain_costs(source: DiscreteMeasure, target: DiscreteMeasure, directions: Tensor, p: float) -> Tensor:
    projected, projected_target = directions @ source.points.T, directions @ target.points.T
    if _same_equal_masses(source.weights, target.weights):
        return paired_cost(projected, projected_target, p)
    return quantile_cost(projected, source.weights, projected_target, target.weights, p)


def _for_kernel(points: Tensor) -> bool:
    return points.device.type == "cpu" and points.dtype in (torch.float32, torch.float64)


class _FusedSliced(torch.autograd.Function):
    """The kernel, which yields value and gradient in one pass: the gradient waits for the backward pass."""

    @staticmethod
    def forward(ctx, source, source_weights, target, target_weights, directions, p):
        tensors = (source, source_weights, target, target_weights)
        costs, gradients = fused_slices(tensors, directions, p, ctx.needs_input_grad[:4])
        ctx.gradients = [None if g is None else torch.from_numpy(g).to(source.dtype) for g in gradients]
        return source.new_tensor(costs.mean())

    @staticmethod
    @once_differentiable
    def backward(ctx, grad_output):
        return *(None if g is None else grad_output * g for g in ctx.gradients), None, None


def _same_equal_masses(weights: Tensor, others: Tensor) -> bool:
    """Whether every point of both measures carries the same fixed mass, so that transport pairs sorted points."""
    if weights.shape != others.shape or weights.requires_grad or others.requires_grad:
        return False
    return bool((weights == weights[0]).all()) and bool((others == weights[0]).all())


def paired_cost(source: Float[Tensor, "L n"], target: Float[Tensor, "L n"], p: float = 2) -> Float[Tensor, " L"]:
    """W_p^p between equally many points of equal mass on a line, for every row: the mean over sorted pairs."""
    gap = source.gather(1, _row_order(source)) - target.gather(1, _row_order(target))
    return power(gap, p).mean(dim=1)


def _row_order(values: Tensor, kind: str = "quicksort") -> Tensor:
    # On a CPU, NumPy sorts several times faster than torch; a stable sort of a few sorted runs merges them.
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
    """W_p^p between weighted points on a line, for every row: ∫₀¹ |F⁻¹(z) − G⁻¹(z)|^p dz.

    The quantile functions are steps; merging their jumps cuts [0, 1] into cells on which both are constant.
    """
    source_order, target_order = _row_order(source), _row_order(target)
    source, target = source.gather(1, source_order), target.gather(1, target_order)
    source_mass = source_weights[source_order].cumsum(dim=1)  # (L, n): where each step of F⁻¹ ends
    target_mass = target_weights[target_order].cumsum(dim=1)
    ends = torch.cat([source_mass, target_mass], dim=1)
    order = _row_order(ends, "stable")
    cell_ends = ends.gather(1, order)  # (L, n + m)
    # How many steps of either side have ended before a cell tells which step it lies in.
    of_source = (order < source.shape[1]).long()
    ended = of_source.cumsum(dim=1) - of_source
    source_step = ended.clamp(max=source.shape[1] - 1)
    target_step = (torch.arange(ends.shape[1], device=ends.device) - ended).clamp(max=target.shape[1] - 1)
    gap = source.gather(1, source_step) - target.gather(1, target_step)
    cell_mass = torch.diff(cell_ends, dim=1, prepend=torch.zeros_like(cell_ends[:, :1]))
    return (power(gap, p) * cell_mass).sum(dim=1)


def power(gap: Tensor, p: float) -> Tensor:
    """|gap|^p; the square without a root or a logarithm, so that gradients stay finite at zero."""
    if p == 2:
        return gap.square()
    return gap.abs() if p == 1 else gap.abs().pow(p)
