"""Integration of velocity fields: positions of points after unit time. The only module that imports torchdiffeq."""

import math
from collections.abc import Callable

import torch
from torch import nn
from torchdiffeq import odeint, odeint_adjoint

from meshot.errors import as_points, require_choice, require_positive_integer
from meshot.flow.fields import Prepared, Velocity, VelocityField
from meshot.types import Float, Tensor

METHODS = ("euler", "midpoint", "rk4", "dopri5")  # of order 1, 2, 4 and 5
GRADIENTS = ("direct", "adjoint")


def integrate(
    field: VelocityField | Velocity,
    points: Float[Tensor, "n d"],
    n_steps: int = 12,
    method: str = "euler",
    inverse: bool = False,
    gradient: str = "direct",
    tolerance: float | None = None,
) -> Float[Tensor, "n d"]:
    """The flow map φ(x) = x(1), where dx/dt = v(t, x) and x(0) = x; or its inverse.

    The result is differentiable with respect to the points and to the parameters of the field.

    Parameters
    ----------
    field : VelocityField, or callable of (time, points)
    points : tensor
        In float16 or bfloat16 they are moved in the dtype of the parameters of the field, if it has any, and returned
        in the dtype that came.
    n_steps : int
        Number of equal steps on [0, 1]. Each evaluates the field 1 (euler), 2 (midpoint), 4 (rk4) or 7 (dopri5) times.
    method : str
        "euler", "midpoint", "rk4" or "dopri5", of order 1, 2, 4 and 5 in the step size.
    inverse : bool
        Integrate backwards, from time 1 to 0. This inverts the flow up to the error of the method.
    gradient : str
        "direct" differentiates through the steps: exact for the computed values, with memory proportional to the number
        of steps. "adjoint" integrates a second flow backwards in time: with constant memory, but with an error of the
        order of the method. It gives gradients for the parameters of a :class:`meshot.flow.VelocityField` or an
        ``nn.Module``; for any other callable, for the points only.
    tolerance : float, optional
        For dopri5 only: subdivide steps until the estimated error of each is below the tolerance, relative to the size
        of the coordinates and absolute in their unit. Without it there are exactly ``n_steps`` steps.

    Raises
    ------
    ValueError
        If ``n_steps`` < 1, the method or the kind of gradient is unknown, ``tolerance`` is not positive or is given
        with another method, or the points are not a matrix of finite floating-point numbers.

    Notes
    -----
    If the field jumps in time at the end of a step, the step uses the value on its own side of the jump.

    References
    ----------
    Chen et al., *Neural ordinary differential equations*, 2018; Dormand and Prince, 1980.

    Examples
    --------
    >>> import torch, meshot
    >>> points = torch.ones(1, 2, dtype=torch.float64)
    >>> decayed = meshot.integrate(lambda time, x: -x, points, n_steps=100, method="rk4")
    >>> [round(x, 6) for x in decayed[0].tolist()]  # 1/e
    [0.367879, 0.367879]
    """
    prepared, dtype = _prepared(field), torch.as_tensor(points).dtype
    points = _as_moved(points, prepared)
    grid = _time_grid(points, n_steps, inverse)
    options = _solver_options(grid, method, tolerance)
    require_choice(gradient, "gradient", GRADIENTS)
    if gradient == "direct":
        return odeint(prepared, points, grid[[0, -1]], **options)[-1].to(dtype)
    return odeint_adjoint(prepared, points, grid[[0, -1]], adjoint_params=prepared.tensors, **options)[-1].to(dtype)


def trajectory(
    field: VelocityField | Velocity,
    points: Float[Tensor, "n d"],
    n_steps: int = 12,
    method: str = "euler",
    inverse: bool = False,
) -> Float[Tensor, "k n d"]:
    """Positions of the points before the first step and after each step: ``n_steps`` + 1 positions of every point.

    The last is the result of :func:`meshot.integrate`. The arguments are the same.
    """
    prepared, dtype = _prepared(field), torch.as_tensor(points).dtype
    points = _as_moved(points, prepared)
    grid = _time_grid(points, n_steps, inverse)
    return odeint(prepared, points, grid, **_solver_options(grid, method, None)).to(dtype)


def step_maps(
    velocity: Velocity, points: Float[Tensor, "n d"], n_steps: int, method: str
) -> list[tuple[Tensor, Callable[[Tensor], Tensor]]]:
    """The steps of :func:`trajectory`: for each, its start time and the map that it applies to points."""
    grid = _time_grid(points, n_steps, inverse=False)

    def step(ends: Tensor) -> Callable[[Tensor], Tensor]:
        return lambda x: odeint(velocity, x, ends, **_solver_options(ends, method, None))[-1]

    return [(grid[k], step(grid[k : k + 2])) for k in range(n_steps)]


def _time_grid(points: Tensor, n_steps: int, inverse: bool) -> Float[Tensor, " k"]:
    require_positive_integer(n_steps, "n_steps")
    grid = torch.arange(n_steps + 1, dtype=points.dtype, device=points.device) / n_steps
    return grid.flip(0) if inverse else grid


def _solver_options(grid: Tensor, method: str, tolerance: float | None) -> dict:
    """Options that make the solver step on the grid, in both directions of time."""
    require_choice(method, "method", METHODS)
    if tolerance is not None and (method != "dopri5" or not 0 < tolerance < math.inf):
        raise ValueError(f"tolerance is {tolerance!r} with {method}; a number > 0 and the method dopri5 are needed")
    if method != "dopri5":
        # By default the solver steps only between the requested times.
        on_grid = {"grid_constructor": lambda f, y, t: grid if t[0] == grid[0] else grid.flip(0), "perturb": True}
        return {"method": method, "options": on_grid}
        # A first step beyond the end is shortened to the first stop. Without a tolerance, so is every other step.
    stops = {"jump_t": grid[1:-1].double(), "step_t": grid[[0, -1]].double()}
    if tolerance is None:
        return {"method": method, "rtol": 0.0, "atol": math.inf, "options": stops | {"first_step": 2.0}}
    return {"method": method, "rtol": tolerance, "atol": tolerance, "options": stops}


def _as_moved(points: Tensor, field: Prepared) -> Tensor:
    """The points, from half precision to the dtype of the parameters of the field."""
    points = as_points(points, "points")
    half = points.dtype in (torch.float16, torch.bfloat16)
    return points.to(field.tensors[0].dtype) if half and field.tensors else points


def _prepared(field: VelocityField | Velocity) -> Prepared:
    if isinstance(field, VelocityField):
        return field.prepared()
    return Prepared(field, tuple(field.parameters()) if isinstance(field, nn.Module) else ())
