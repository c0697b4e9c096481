"""The state of a fit: that of a training, plus the number of integration steps, which a guard may change."""

from meshot.flow.fields.field import LearnedVelocity
from meshot.train import TrainingState


class FitState(TrainingState):
    """The state of a fit: the field, its optimiser, the progress, and the best field so far.

    Parameters
    ----------
    field : LearnedVelocity
    learning_rate : float
    n_steps : int
        Initial number of integration steps.
    """

    def __init__(self, field: LearnedVelocity, learning_rate: float, n_steps: int):
        super().__init__(field, learning_rate, extras={"n_steps": n_steps})

    @property
    def n_steps(self) -> int:
        """Number of integration steps."""
        return self.extras["n_steps"]

    @n_steps.setter
    def n_steps(self, value: int) -> None:
        """Set the number of integration steps."""
        self.extras["n_steps"] = value
