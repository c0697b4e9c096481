"""The interface of velocity fields: a velocity for every point at every time in [0, 1], and its Lipschitz constant."""

import abc
import dataclasses
from collections.abc import Callable

from torch import nn

from meshot.types import Float, Tensor

Velocity = Callable[[Tensor, Tensor], Tensor]  # (time, points) → velocities


@dataclasses.dataclass(frozen=True, eq=False)
class Prepared:
    """A velocity for repeated evaluation: everything that does not depend on the points is already computed.

    Parameters
    ----------
    velocity : callable of (time, points)
    tensors : tuple of tensor
        The tensors that the velocity depends on and that may need gradients. The adjoint method requires this list.
    """

    velocity: Velocity
    tensors: tuple[Tensor, ...] = ()

    def __call__(self, time: Float[Tensor, ""], points: Float[Tensor, "n d"]) -> Float[Tensor, "n d"]:
        """The velocity of every point at one time."""
        return self.velocity(time, points)


class VelocityField(abc.ABC):
    """A velocity v(t, x). If it is Lipschitz in x, its flow is a homeomorphism: trajectories do not meet."""

    #: Whether a finite L exists with ‖v(t, x) − v(t, y)‖ ≤ L ‖x − y‖ for all x, y and t.
    is_lipschitz: bool = True

    @abc.abstractmethod
    def __call__(self, time: Float[Tensor, ""], points: Float[Tensor, "n d"]) -> Float[Tensor, "n d"]:
        """The velocity of every point at one time."""

    @abc.abstractmethod
    def lipschitz_bound(self) -> Float[Tensor, ""]:
        """An upper bound of the Lipschitz constant in x, per unit of time; infinite if there is none. Without gradient.

        It is a number L with ‖v(t, x) − v(t, y)‖ ≤ L ‖x − y‖ for all x, y and t.
        :func:`meshot.flow.crossings.sampled_lipschitz` estimates the constant from below.
        """

    def prepared(self) -> Prepared:
        """The same field for repeated evaluation. Called once per flow, not once per step."""
        return Prepared(self)


class LearnedVelocity(nn.Module, VelocityField):
    """A velocity field with parameters that can be fitted."""

    def prepared(self) -> Prepared:
        """The field and its parameters."""
        return Prepared(self, tuple(self.parameters()))

    def stages(self) -> list[list[nn.Parameter]]:
        """Groups of parameters in the order in which a coarse-to-fine fit releases them; by default one group."""
        return [list(self.parameters())]


def euler_is_injective(field: VelocityField, n_steps: int) -> bool:
    """Whether the bound h·L < 1 guarantees that every Euler step of size 1/``n_steps`` is injective.

    The condition is sufficient, not necessary, and concerns points. Triangles between moving vertices may still
    intersect.
    """
    return bool(field.lipschitz_bound() < n_steps)
