"""Analytic fields that depend on time, and one that is not Lipschitz: what the theory allows, and what it forbids."""

import dataclasses
import math

import torch

from meshot.errors import as_floating
from meshot.types import Float, Tensor
from meshot_book.flows import AnalyticField


@dataclasses.dataclass(frozen=True, eq=False)
class Accelerated(AnalyticField):
    """(1 + rate · t) times a steady field: the same paths, passed through at another pace."""

    field: AnalyticField  # that does not depend on time
    rate: float

    def __call__(self, time: Float[Tensor, ""], points: Float[Tensor, "n d"]) -> Float[Tensor, "n d"]:
        """The velocity of every point at one time."""
        return (1 + self.rate * time) * self.field(time, points)

    def flow(self, points: Float[Tensor, "n d"], start: float = 0.0, end: float = 1.0) -> Float[Tensor, "n d"]:
        """The flow of the steady field for the integral of 1 + rate · t."""
        return self.field.flow(points, 0.0, end - start + self.rate * (end**2 - start**2) / 2)

    def lipschitz_bound(self) -> Float[Tensor, ""]:
        """The constant of the steady field times the largest factor on [0, 1]."""
        return self.field.lipschitz_bound() * max(1.0, abs(1 + self.rate))


@dataclasses.dataclass(frozen=True, eq=False)
class Drifting(AnalyticField):
    """A steady field carried along at constant velocity: v(t, x) = drift + field(x − t · drift).

    Parameters
    ----------
    field : AnalyticField
        That does not depend on time.
    drift : tensor
        In units of the points per unit of time.

    Raises
    ------
    ValueError
        If the drift is not made of finite floating-point numbers.
    """

    field: AnalyticField
    drift: Float[Tensor, " d"]

    def __post_init__(self):
        object.__setattr__(self, "drift", as_floating(self.drift, "drift"))

    def __call__(self, time: Float[Tensor, ""], points: Float[Tensor, "n d"]) -> Float[Tensor, "n d"]:
        """The velocity of every point at one time."""
        drift = self.drift.to(points)
        return drift + self.field(time, points - time * drift)

    def flow(self, points: Float[Tensor, "n d"], start: float = 0.0, end: float = 1.0) -> Float[Tensor, "n d"]:
        """The flow of the steady field, seen from the ground."""
        drift = self.drift.to(points)
        return end * drift + self.field.flow(points - start * drift, start, end)

    def lipschitz_bound(self) -> Float[Tensor, ""]:
        """The constant of the steady field."""
        return self.field.lipschitz_bound()


@dataclasses.dataclass(frozen=True, eq=False)
class RootSink(AnalyticField):
    """``v = −2 sign(x) √|x|`` in every coordinate: continuous but not Lipschitz at zero, where trajectories meet.

    A coordinate x is ``(√|x| − t)²`` until it reaches zero at ``t = √|x|``, and stays there. Backwards there is no
    telling when it came.
    """

    is_lipschitz = False

    def __call__(self, time: Float[Tensor, ""], points: Float[Tensor, "n d"]) -> Float[Tensor, "n d"]:
        """The velocity of every point."""
        return -2 * points.sign() * points.abs().sqrt()

    def flow(self, points: Float[Tensor, "n d"], start: float = 0.0, end: float = 1.0) -> Float[Tensor, "n d"]:
        """Forward only.

        Raises
        ------
        ValueError
            If ``end`` is before ``start``.
        """
        if end < start:
            raise ValueError(f"end is {end}, before start, {start}; this flow has no inverse, run it forward")
        return points.sign() * (points.abs().sqrt() - (end - start)).clamp(min=0).square()

    def lipschitz_bound(self) -> Float[Tensor, ""]:
        """Infinite."""
        return torch.tensor(math.inf, dtype=torch.float64)
