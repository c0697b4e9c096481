"""What a velocity field is: a velocity for every point at every time in [0, 1]."""

import abc
from collections.abc import Callable

from torch import nn

from meshot.types import Float, Tensor

Velocity = Callable[[Tensor, Tensor], Tensor]  # (time, points) → velocities


class VelocityField(nn.Module, abc.ABC):
    """A learned velocity v(t, x), Lipschitz in x: its flow is a homeomorphism, its trajectories cannot meet."""

    @abc.abstractmethod
    def forward(self, time: Float[Tensor, ""], points: Float[Tensor, "n d"]) -> Float[Tensor, "n d"]:
        """The velocity of every point at one time."""

    @abc.abstractmethod
    def lipschitz_bound(self) -> Float[Tensor, ""]:
        """A number L with ‖v(t, x) − v(t, y)‖ ≤ L ‖x − y‖ for all x, y and t; without gradient."""

    def prepared(self) -> Velocity:
        """The same field with everything computed that does not depend on the points: once per flow, not per step."""
        return self


def euler_is_injective(field: VelocityField, n_steps: int) -> bool:
    """Whether every Euler step of 1/``n_steps`` is one-to-one by the bound h·L < 1 (sufficient, not necessary).

    This speaks of points. Triangles with moving corners may cross all the same.
    """
    return bool(field.lipschitz_bound() < n_steps)
