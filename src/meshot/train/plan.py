"""The plan of a training: number of steps, learning rate, validation."""

import dataclasses
import math

from meshot.errors import require_choice, require_positive, require_positive_integer

SCHEDULES = ("constant", "cosine")


@dataclasses.dataclass(frozen=True, eq=False)
class Plan:
    """The plan of a training.

    Parameters
    ----------
    n_steps : int
    validate_every, save_every : int
        In steps.
    patience : int, optional
        Stop after this many consecutive validations without a lower loss. None: never.
    learning_rate : float
        The initial learning rate.
    schedule : str
        "constant", or "cosine": half a cosine to zero.
    averaging : float
        In [0, 1). If positive, the exponential moving average of the weights with this decay per step is validated and
        stored, instead of the weights themselves.
    """

    n_steps: int
    validate_every: int
    save_every: int
    patience: int | None
    learning_rate: float
    schedule: str
    averaging: float = 0.0

    def learning_rate_at(self, step: int) -> float:
        """The learning rate of one step."""
        if self.schedule == "constant":
            return self.learning_rate
        return self.learning_rate * 0.5 * (1 + math.cos(math.pi * step / self.n_steps))


def plan_of_epochs(settings: object, n_examples: int) -> Plan:
    """The plan of settings that count in epochs, for a number of training examples.

    Parameters
    ----------
    settings : object
        With the attributes that :func:`meshot.train.require_plan_settings` checks. One step uses ``batch_size``
        examples, or one example if there is no such attribute.
    n_examples : int
    """
    per_epoch = -(-n_examples // getattr(settings, "batch_size", 1))
    return Plan(
        settings.n_epochs * per_epoch, settings.validate_every * per_epoch, settings.save_every, settings.patience,
        settings.learning_rate, settings.schedule, settings.averaging,
    )  # fmt: skip


def require_plan_settings(settings: object) -> None:
    """Check the settings that all trainings have: epochs, learning rate, patience, averaging, seed.

    Raises
    ------
    ValueError
        If one is outside its range.
    """
    for name in ("n_epochs", "batch_size", "validate_every", "save_every"):
        require_positive_integer(getattr(settings, name, 1), name)
    if settings.patience is not None:
        require_positive_integer(settings.patience, "patience")
    require_positive(settings.learning_rate, "learning_rate")
    if not 0 <= settings.averaging < 1:
        raise ValueError(f"averaging is {settings.averaging!r}; a share in [0, 1) is needed, 0 for none")
    if isinstance(settings.seed, bool) or not isinstance(settings.seed, int) or settings.seed < 0:
        raise ValueError(f"seed is {settings.seed!r}; an integer >= 0 is needed")
    require_choice(settings.schedule, "schedule", SCHEDULES)
