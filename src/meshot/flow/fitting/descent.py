"""Gradient descent on the positions of free points, without connectivity between them."""

import dataclasses
from collections.abc import Callable, Sequence

import torch

from meshot.errors import as_floating, require_finite, require_positive_integer, require_shape
from meshot.types import Float, Tensor

PointLoss = Callable[[Tensor], Tensor]


@dataclasses.dataclass(frozen=True, eq=False)
class Descent:
    """The result of a descent: the loss before every step, and the points after selected steps.

    Parameters
    ----------
    losses : tensor
        Entry k is the loss before the (k + 1)-th step.
    steps : tuple of int
        The numbers of steps after which the points were stored, in ascending order.
    snapshots : tensor
        The points after these numbers of steps.
    """

    losses: Float[Tensor, " n_steps"]
    steps: tuple[int, ...]
    snapshots: Float[Tensor, "k n d"]

    @property
    def points(self) -> Float[Tensor, "n d"]:
        """The last stored points."""
        return self.snapshots[-1]

    def at(self, step: int) -> Float[Tensor, "n d"]:
        """The points after ``step`` steps.

        Raises
        ------
        ValueError
            If the points were not stored after that step.
        """
        if step not in self.steps:
            raise ValueError(f"step is {step}; points were kept only after {self.steps}: ask for it in `keep`")
        return self.snapshots[self.steps.index(step)]


def descend(
    loss: PointLoss,
    points: Float[Tensor, "n d"],
    n_steps: int = 1000,
    learning_rate: float = 1.0,
    momentum: float = 0.9,
    keep: Sequence[int] | None = None,
) -> Descent:
    """Minimise a loss over the positions of free points, by stochastic gradient descent with momentum.

    This is the toy experiment of the paper. The step is v ← momentum · v + ∇loss(x), then x ← x − learning_rate · v,
    from v = 0, as in ``torch.optim.SGD``. Along a direction of curvature c (loss = c x² / 2) it is stable if and only
    if 0 < learning_rate · c < 2 (1 + momentum).

    Parameters
    ----------
    loss : callable
        Takes the points and returns one number. It may draw new random directions at each call, from a generator of its
        own.
    points : tensor
        The initial positions. They are not modified.
    n_steps : int
    learning_rate, momentum : float
        ``learning_rate`` > 0, 0 <= ``momentum`` < 1.
    keep : sequence of int, optional
        Numbers of steps after which to store the points. The last step is always stored, and by default it alone.

    Raises
    ------
    ValueError
        If an argument is outside its range, or the points become infinite or NaN (the learning rate is too large).

    References
    ----------
    Polyak, *Some methods of speeding up the convergence of iteration methods*, 1964.
    """
    points = as_floating(points, "points")
    require_shape(points, "points", None)
    require_positive_integer(n_steps, "n_steps")
    _require_rates(learning_rate, momentum)
    wanted = _kept_steps(keep, n_steps)
    moving = points.detach().clone().requires_grad_()
    optimiser = torch.optim.SGD([moving], lr=learning_rate, momentum=momentum)
    losses, snapshots = [], [points.detach().clone()] if 0 in wanted else []
    for step in range(1, n_steps + 1):
        optimiser.zero_grad()
        value = loss(moving)
        value.backward()
        optimiser.step()
        losses.append(value.detach())
        if step in wanted:
            require_finite(moving, f"points after {step} steps (try a smaller learning_rate)")
            snapshots.append(moving.detach().clone())
    return Descent(torch.stack(losses), wanted, torch.stack(snapshots))


def _require_rates(learning_rate: float, momentum: float) -> None:
    if not learning_rate > 0:
        raise ValueError(f"learning_rate is {learning_rate!r}; a number > 0 is needed")
    if not 0 <= momentum < 1:
        raise ValueError(f"momentum is {momentum!r}; a number in [0, 1) is needed")


def _kept_steps(keep: Sequence[int] | None, n_steps: int) -> tuple[int, ...]:
    kept = sorted({int(step) for step in keep or ()} | {n_steps})
    if kept[0] < 0 or kept[-1] > n_steps:
        raise ValueError(f"keep asks for steps from {kept[0]} to {kept[-1]}; they must lie in [0, {n_steps}]")
    return tuple(kept)
