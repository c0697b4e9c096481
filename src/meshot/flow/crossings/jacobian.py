"""Jacobians of a velocity, and an estimate of its Lipschitz constant from below."""

from collections.abc import Callable

import torch

from meshot.errors import as_floating, require_positive_integer, require_shape
from meshot.flow.fields.field import Velocity, VelocityField
from meshot.types import Float, Tensor


def point_jacobians(function: Callable[[Tensor], Tensor], points: Float[Tensor, "n d"]) -> Float[Tensor, "n d d"]:
    """The Jacobian at every point of a map that acts on each point separately: entry (i, j, k) is ∂f_j/∂x_k at point i.

    Needs d backward passes, for any number of points. Without gradient.
    """
    moving = points.detach().clone().requires_grad_()
    with torch.enable_grad():
        values = function(moving)
        if not values.requires_grad:
            return moving.new_zeros(*moving.shape, moving.shape[1])
        columns = range(values.shape[1])
        # A component that does not depend on the points has no gradient: materialize_grads gives zeros.
        rows = [
            torch.autograd.grad(values[:, j].sum(), moving, retain_graph=True, materialize_grads=True)[0]
            for j in columns
        ]
    return torch.stack(rows, dim=1)


def sampled_lipschitz(
    field: VelocityField | Velocity, points: Float[Tensor, "n d"], n_times: int = 4
) -> Float[Tensor, ""]:
    """The largest spectral norm of the velocity's Jacobian over the points and over equally spaced times.

    The result is a lower bound of the Lipschitz constant, per unit of time, and converges to it as the points become
    dense. For an upper bound, see :meth:`meshot.flow.fields.VelocityField.lipschitz_bound`.

    Parameters
    ----------
    field : VelocityField, or callable of (time, points)
    points : tensor
        Positions at which the Jacobian is computed.
    n_times : int
        Number of times in (0, 1).

    Raises
    ------
    ValueError
        If the points are not a matrix of finite floating-point numbers, or ``n_times`` < 1.
    """
    points = as_floating(points, "points")
    require_shape(points, "points", None)
    require_positive_integer(n_times, "n_times")
    velocity = field.prepared() if isinstance(field, VelocityField) else field
    times = (torch.arange(n_times, dtype=points.dtype, device=points.device) + 0.5) / n_times
    norms = [
        torch.linalg.matrix_norm(point_jacobians(lambda x, t=time: velocity(t, x), points), ord=2).max()
        for time in times
    ]
    return torch.stack(norms).max()
