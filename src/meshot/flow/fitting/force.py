"""Descent directions of a loss of points, at the points and at additional positions."""

import torch

from meshot.errors import as_floating, require_shape
from meshot.flow.fitting.descent import PointLoss
from meshot.types import Float, Tensor


def forces(loss: PointLoss, points: Float[Tensor, "n d"]) -> Float[Tensor, "n d"]:
    """The force on every point: −n/2 times the gradient of the loss, where n is the number of points.

    The factor cancels the mean over n points and the factor 2 of a squared distance. For the mean of the squared
    distances ‖xᵢ − yᵢ‖², the force on xᵢ is yᵢ − xᵢ, in units of the points.

    Parameters
    ----------
    loss : callable
        Takes the points and returns one number.
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


def probe_forces(loss: PointLoss, points: Float[Tensor, "n d"], probes: Float[Tensor, "k d"]) -> Float[Tensor, "k d"]:
    """The force on an additional point at each probe position: one probe at a time is appended to the points.

    Needs one evaluation of the loss per probe.

    Raises
    ------
    ValueError
        As :func:`meshot.flow.fitting.forces`.
    """
    return torch.stack([forces(loss, torch.cat([points, probe[None]]))[-1] for probe in probes])
