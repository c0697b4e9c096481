"""Velocity fields whose flow is known in closed form, to test integrators and bounds."""

import abc
import dataclasses
import math

import torch

from meshot.errors import as_floating, require_positive
from meshot.flow.fields.field import VelocityField
from meshot.types import Float, Tensor


class AnalyticField(VelocityField):
    """A field with a closed-form flow and a known Lipschitz constant."""

    @abc.abstractmethod
    def flow(self, points: Float[Tensor, "n d"], start: float = 0.0, end: float = 1.0) -> Float[Tensor, "n d"]:
        """Positions at time ``end`` of points that are at ``points`` at time ``start``; ``end`` may be earlier."""


@dataclasses.dataclass(frozen=True, eq=False)
class Affine(AnalyticField):
    """v = A x + b. The flow is given by the matrix exponential; the Lipschitz constant is the spectral norm of A.

    Parameters
    ----------
    matrix : tensor
    offset : tensor, optional
        b, zero by default.

    Raises
    ------
    ValueError
        If the matrix is not square, or the offset has another length.
    """

    matrix: Float[Tensor, "d d"]
    offset: Float[Tensor, " d"] | None = None

    def __post_init__(self):
        matrix = as_floating(self.matrix, "matrix")
        if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1]:
            raise ValueError(f"matrix has shape {tuple(matrix.shape)}; (d, d) is needed")
        offset = matrix.new_zeros(len(matrix)) if self.offset is None else as_floating(self.offset, "offset")
        if offset.shape != (len(matrix),):
            raise ValueError(f"offset has shape {tuple(offset.shape)}; ({len(matrix)},) is needed, as for the matrix")
        object.__setattr__(self, "offset", offset)

    def __call__(self, time: Float[Tensor, ""], points: Float[Tensor, "n d"]) -> Float[Tensor, "n d"]:
        """The velocity of every point."""
        return points @ self.matrix.to(points).T + self.offset.to(points)

    def flow(self, points: Float[Tensor, "n d"], start: float = 0.0, end: float = 1.0) -> Float[Tensor, "n d"]:
        """The flow map: the matrix exponential of A, with b as an additional column."""
        d = len(self.matrix)
        wide = self.matrix.new_zeros(d + 1, d + 1)
        wide[:d, :d], wide[:d, d] = self.matrix, self.offset
        moved = torch.linalg.matrix_exp((end - start) * wide).to(points)
        return points @ moved[:d, :d].T + moved[:d, d]

    @torch.no_grad()
    def lipschitz_bound(self) -> Float[Tensor, ""]:
        """The largest singular value of the matrix, which is the exact constant."""
        return torch.linalg.matrix_norm(self.matrix, ord=2)


def rotation(angle: float) -> Affine:
    """The rotation of the plane by ``angle`` radians in unit time. Its Lipschitz constant is ``|angle|``."""
    return spiral(angle, 0.0)


def spiral(angle: float, growth: float) -> Affine:
    """A rotation of the plane combined with scaling by exp(``growth``) in unit time.

    Its Lipschitz constant is √(angle² + growth²).
    """
    return Affine(torch.tensor([[growth, -angle], [angle, growth]], dtype=torch.float64))


def shear(rate: float) -> Affine:
    """(x, y) ↦ (x + rate · y, y) in unit time. Its Lipschitz constant is ``|rate|``, and one Euler step is exact."""
    return Affine(torch.tensor([[0.0, rate], [0.0, 0.0]], dtype=torch.float64))


@dataclasses.dataclass(frozen=True, eq=False)
class Vortex(AnalyticField):
    """A rotation about an axis with angular velocity ω(r) = strength · exp(−r² / (2 radius²)), in the first two axes.

    The angular velocity is constant on each circle, so the flow is known in closed form.
    ``‖Dv‖ = max(|ω|, |ω + r ω′|) ≤ |strength|``, with equality at the axis.

    Parameters
    ----------
    strength : float
        Angular velocity at the axis, in radians per unit of time.
    radius : float
        Distance from the axis at which the angular velocity is exp(−1/2) times that at the axis, in units of the
        points.

    Raises
    ------
    ValueError
        If the radius is not positive.
    """

    strength: float
    radius: float = 1.0

    def __post_init__(self):
        require_positive(self.radius, "radius")

    def _angles(self, points: Tensor) -> Float[Tensor, "n 1"]:
        return self.strength * torch.exp(-points[:, :2].square().sum(dim=1, keepdim=True) / (2 * self.radius**2))

    def __call__(self, time: Float[Tensor, ""], points: Float[Tensor, "n d"]) -> Float[Tensor, "n d"]:
        """The velocity of every point."""
        turned = torch.stack([-points[:, 1], points[:, 0]], dim=1)
        return torch.cat([self._angles(points) * turned, torch.zeros_like(points[:, 2:])], dim=1)

    def flow(self, points: Float[Tensor, "n d"], start: float = 0.0, end: float = 1.0) -> Float[Tensor, "n d"]:
        """Positions after rotation of every point about the axis by its own angle."""
        angles, x, y = (end - start) * self._angles(points), points[:, :1], points[:, 1:2]
        cosines, sines = angles.cos(), angles.sin()
        return torch.cat([cosines * x - sines * y, sines * x + cosines * y, points[:, 2:]], dim=1)

    def lipschitz_bound(self) -> Float[Tensor, ""]:
        """``|strength|``, which is the exact constant."""
        return torch.tensor(abs(self.strength), dtype=torch.float64)


@dataclasses.dataclass(frozen=True, eq=False)
class Push(AnalyticField):
    """A velocity along the second axis: v = strength · exp(−ρ² / (2 width²)), where ρ is the distance from that axis.

    Motion along the axis does not change ρ, so one Euler step is exact for any strength.

    Parameters
    ----------
    strength : float
        Velocity on the axis, in units of the points per unit of time.
    width : float
        In units of the points. The Lipschitz constant is ``|strength| / (width · √e)``.

    Raises
    ------
    ValueError
        If the width is not positive.
    """

    strength: float
    width: float = 1.0

    def __post_init__(self):
        require_positive(self.width, "width")

    def __call__(self, time: Float[Tensor, ""], points: Float[Tensor, "n d"]) -> Float[Tensor, "n d"]:
        """The velocity of every point."""
        aside = points.clone()
        aside[:, 1] = 0
        speed = self.strength * torch.exp(-aside.square().sum(dim=1) / (2 * self.width**2))
        along = torch.zeros(points.shape[1], dtype=points.dtype, device=points.device)
        along[1] = 1
        return speed[:, None] * along

    def flow(self, points: Float[Tensor, "n d"], start: float = 0.0, end: float = 1.0) -> Float[Tensor, "n d"]:
        """The position plus velocity times elapsed time."""
        return points + (end - start) * self(points.new_tensor(start), points)

    def lipschitz_bound(self) -> Float[Tensor, ""]:
        """The exact constant, ``|strength| / (width · √e)``."""
        return torch.tensor(abs(self.strength) * math.exp(-0.5) / self.width, dtype=torch.float64)
