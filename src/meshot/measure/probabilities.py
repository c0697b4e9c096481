"""The check of weights: masses, each at least zero, that sum to one."""

import torch

from meshot.errors import as_floating
from meshot.types import Float, Tensor

_NEAR_ONE = 1e-5  # a sum within this of one is taken for rounding, such as of weights made in single precision
# A sum of n numbers, added in pairs, is off by at most log2(n) units of rounding, below 32. Weights were divided by one
# such sum and are added up by another: up to twice that is no reason to change them.
_ROUNDING = 64


def as_probabilities(weights: object, points: Tensor, n_items: int) -> Float[Tensor, " n"]:
    """``n_items`` masses that sum to one, of the dtype of the points.

    Weights of another floating-point type are cast. A sum within 1e-5 of one is mended by dividing by it, unless it is
    as near as rounding allows; the gradient takes that sum as a constant.

    Parameters
    ----------
    weights : tensor or array
        Each at least zero.
    points : tensor
        Whose dtype the weights get, and on whose device they must be.
    n_items : int

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
