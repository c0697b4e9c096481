"""What a velocity field is: a velocity for every point at every time in [0, 1], and how fast it can vary."""

import abc
import dataclasses
from collections.abc import Callable

from torch import nn

from meshot.types import Float, Tensor

Velocity = Callable[[Tensor, Tensor], Tensor]  # (time, points) → velocities


@dataclasses.dataclass(frozen=True, eq=False)
class Prepared:
    """A velocity with everything computed that does not depend on the points.

    Parameters
    ----------
    velocity : callable of (time, points)
    tensors : tuple of tensor
        What the velocity is made of, where gradients may be wanted: the adjoint method has to be told.
    """

    velocity: Velocity
    tensors: tuple[Tensor, ...] = ()

    def __call__(self, time: Float[Tensor, ""], points: Float[Tensor, "n d"]) -> Float[Tensor, "n d"]:
        """The velocity of every point at one time."""
        return self.velocity(time, points)


class VelocityField(abc.ABC):
    """A velocity v(t, x). Where it is Lipschitz in x, its flow is a homeomorphism: trajectories cannot meet."""

    #: Whether some finite L has ‖v(t, x) − v(t, y)‖ ≤ L ‖x − y‖ for all x, y and t.
    is_lipschitz: bool = True

    @abc.abstractmethod
    def __call__(self, time: Float[Tensor, ""], points: Float[Tensor, "n d"]) -> Float[Tensor, "n d"]:
        """The velocity of every point at one time."""

    @abc.abstractmethod
    def lipschitz_bound(self) -> Float[Tensor, ""]:
        """A number L with ‖v(t, x) − v(t, y)‖ ≤ L ‖x − y‖ for all x, y and t, without gradient; infinite if none is.

        :func:`meshot.flow.crossings.sampled_lipschitz` estimates the constant from below.
        """

    def prepared(self) -> Prepared:
        """The same field, ready to be evaluated often: called once per flow, not per step."""
        return Prepared(self)


class LearnedVelocity(nn.Module, VelocityField):
    """A velocity field with parameters."""

    def prepared(self) -> Prepared:
        """The field and its parameters."""
        return Prepared(self, tuple(self.parameters()))

    def stages(self) -> list[list[nn.Parameter]]:
        """The parameters in the order in which a fit from coarse to fine lets them move; all at once by default."""
        return [list(self.parameters())]


def euler_is_injective(field: VelocityField, n_steps: int) -> bool:
    """Whether every Euler step of 1/``n_steps`` is one-to-one by the bound h·L < 1 (sufficient, not necessary).

    This speaks of points. Triangles with moving corners may cross all the same.
    """
    return bool(field.lipschitz_bound() < n_steps)
