"""Where a loss pulls: at the points themselves, and at places where no point is yet."""

import torch

from meshot.errors import as_floating, require_shape
from meshot.flow.fitting.descent import PointLoss
from meshot.types import Float, Tensor


def pulls(loss: PointLoss, points: Float[Tensor, "n d"]) -> Float[Tensor, "n d"]:
    """Where every point is pulled: −n/2 times the gradient of the loss.

    The factor undoes the mean over n points and the 2 of the square, so that for the mean of squared distances
    ‖xᵢ − yᵢ‖² the pull on xᵢ is the vector yᵢ − xᵢ, in units of the points.

    Parameters
    ----------
    loss : callable
        Takes the points, returns one number.
    points : tensor

    Raises
    ------
    ValueError
        If the points are not a finite, floating-point matrix.
    """
    points = as_floating(points, "points")
    require_shape(points, "points", None)
    moving = points.detach().clone().requires_grad_()
    (gradient,) = torch.autograd.grad(loss(moving), moving)
    return -len(points) / 2 * gradient


def probe_pulls(loss: PointLoss, points: Float[Tensor, "n d"], probes: Float[Tensor, "k d"]) -> Float[Tensor, "k d"]:
    """Where one more point would be pulled: each probe in turn joins the points, and its pull is taken.

    One evaluation of the loss per probe.

    Raises
    ------
    ValueError
        As :func:`pulls`.
    """
    return torch.stack([pulls(loss, torch.cat([points, probe[None]]))[-1] for probe in probes])
