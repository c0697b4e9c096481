"""The state of a fit: that of a training, with a number of steps that a guard may change."""

from meshot.flow.fields.field import LearnedVelocity
from meshot.train import TrainingState


class FitState(TrainingState):
    """Where a fit stands: the field, its optimiser, how far it came, and the best so far.

    Parameters
    ----------
    field : LearnedVelocity
    learning_rate : float
    n_steps : int
        Of integration, at the start.
    """

    def __init__(self, field: LearnedVelocity, learning_rate: float, n_steps: int):
        super().__init__(field, learning_rate, extras={"n_steps": n_steps})

    @property
    def n_steps(self) -> int:
        """Steps of integration."""
        return self.extras["n_steps"]

    @n_steps.setter
    def n_steps(self, value: int) -> None:
        """The same, from now on."""
        self.extras["n_steps"] = value
