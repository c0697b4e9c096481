"""The flow of a velocity field: where points are carried in unit time (the one home of torchdiffeq)."""

import torch
from torchdiffeq import odeint

from meshot.errors import as_floating, require_positive_integer, require_shape
from meshot.flow.field import Velocity, VelocityField
from meshot.types import Float, Tensor

METHODS = ("euler", "midpoint", "rk4")  # of order 1, 2 and 4


def integrate(
    field: VelocityField | Velocity,
    points: Float[Tensor, "n d"],
    n_steps: int = 12,
    method: str = "euler",
    inverse: bool = False,
) -> Float[Tensor, "n d"]:
    """The flow map φ(x) = x(1), where dx/dt = v(t, x) and x(0) = x; or its inverse.

    Differentiable in the points and in the parameters of the field.

    Parameters
    ----------
    field : VelocityField, or callable of (time, points)
    points : tensor
    n_steps : int
        Equal steps on [0, 1]; each evaluates the field 1 (euler), 2 (midpoint) or 4 (rk4) times.
    method : str
        "euler", "midpoint" or "rk4": the error falls as the first, second or fourth power of the step.
    inverse : bool
        Run time backwards from 1 to 0. Inverse to the flow up to the error of the method, not to rounding.

    Raises
    ------
    ValueError
        If ``n_steps`` < 1, the method is unknown, or the points are not a matrix of finite floating-point numbers.

    Notes
    -----
    A step that begins or ends where the field jumps in time sees the side that it crosses. Memory grows with the
    number of evaluations, because gradients pass through the steps.
    """
    points = as_floating(points, "points")
    require_shape(points, "points", None)
    require_positive_integer(n_steps, "n_steps")
    if method not in METHODS:
        raise ValueError(f"method is {method!r}; one of {', '.join(METHODS)} is needed")
    grid = torch.arange(n_steps + 1, dtype=points.dtype, device=points.device) / n_steps
    grid = grid.flip(0) if inverse else grid
    velocity = field.prepared() if isinstance(field, VelocityField) else field
    # The solver steps only between the times it is given, unless it is given a grid.
    options = {"grid_constructor": lambda *_: grid, "perturb": True}
    return odeint(velocity, points, grid[[0, -1]], method=method, options=options)[-1]
