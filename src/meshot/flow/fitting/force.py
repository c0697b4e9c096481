"""The force of a loss: on the points themselves, and at positions where no point is yet."""

import torch

from meshot.errors import as_floating, require_shape
from meshot.flow.fitting.descent import PointLoss
from meshot.types import Float, Tensor


def forces(loss: PointLoss, points: Float[Tensor, "n d"]) -> Float[Tensor, "n d"]:
    """The force on every point, −n/2 times the gradient of the loss: the direction in which a descent moves it.

    The factor undoes the mean over n points and the 2 of the square, so that for the mean of squared distances
    ‖xᵢ − yᵢ‖² the force on xᵢ is the vector yᵢ − xᵢ, in units of the points.

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


def probe_forces(loss: PointLoss, points: Float[Tensor, "n d"], probes: Float[Tensor, "k d"]) -> Float[Tensor, "k d"]:
    """The force on one more point: each probe in turn joins the points, and its force is taken.

    One evaluation of the loss per probe.

    Raises
    ------
    ValueError
        As :func:`meshot.flow.fitting.forces`.
    """
    return torch.stack([forces(loss, torch.cat([points, probe[None]]))[-1] for probe in probes])
