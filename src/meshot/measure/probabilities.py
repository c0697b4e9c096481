"""Validation of weights: non-negative masses that sum to one."""

import torch

from meshot.errors import as_floating
from meshot.types import Float, Tensor

_NEAR_ONE = 1e-5  # a sum within this of one is attributed to rounding, for example of single-precision weights
# A pairwise sum of n numbers has an error of at most log2(n) units of rounding, below 32. Weights are divided by one
# such sum and added up by another. Deviations up to twice that bound are therefore not corrected.
_ROUNDING = 64


def as_probabilities(weights: object, points: Tensor, n_items: int) -> Float[Tensor, " n"]:
    """The weights as ``n_items`` masses that sum to one, in the dtype of the points.

    Weights of another floating-point dtype are converted. If the sum is within 1e-5 of one, but not one up to rounding,
    the weights are divided by it. In the gradient that sum is a constant.

    Parameters
    ----------
    weights : tensor or array
        Non-negative.
    points : tensor
        Determines the dtype of the weights, and the device on which they must be.
    n_items : int
        The required number of weights.

    Raises
    ------
    ValueError
        If the shape or the device does not fit, a weight is negative or not finite, or they do not sum to one.
    """
    weights = as_floating(weights, "weights")
    if weights.shape != (n_items,):
        raise ValueError(
            f"weights has shape {tuple(weights.shape)}; ({n_items},) is needed, one for each point or cell"
        )
    if weights.device != points.device:
        raise ValueError(f"weights is on {weights.device}, points on {points.device}: move one with .to(...)")
    if float(weights.detach().min()) < 0:
        raise ValueError(f"weights has a negative entry ({float(weights.detach().min()):.3g}); masses must be >= 0")
    weights = weights.to(points.dtype)
    total, rounding = float(weights.detach().double().sum()), _ROUNDING * torch.finfo(weights.dtype).eps
    if abs(total - 1) > max(_NEAR_ONE, rounding):
        raise ValueError(f"weights sum to {total:.9g}; a probability measure needs 1: divide by weights.sum()")
    return weights if abs(total - 1) <= rounding else weights / total
