"""Settings that all trainings on whole scans share, and their completion from a file."""

import dataclasses
from collections.abc import Mapping

from meshot.errors import require_positive_integer
from meshot.train import Groups, Plan, checked_groups, require_plan_settings, setting_names


@dataclasses.dataclass(frozen=True)
class LearningSettings:
    """Settings of a training in which one step uses one subject.

    Parameters
    ----------
    n_epochs : int
        Number of passes over all training subjects.
    learning_rate, schedule, averaging
        Of Adam: see :class:`meshot.train.Plan`.
    validate_every, patience : int
        In epochs. The training stops after ``patience`` consecutive validations without a lower distance (None: never).
    n_points : int
        Number of points on each surface for the distance in validation.
    save_every : int
        In steps.
    seed : int
        Seed of all random numbers. Step i uses (seed, i), so that a resumed training draws the same numbers.

    Raises
    ------
    ValueError
        If a number is outside its range or a name is unknown.
    """

    n_epochs: int = 100
    learning_rate: float = 1e-3
    schedule: str = "cosine"
    validate_every: int = 10
    patience: int | None = None
    n_points: int = 10_000
    save_every: int = 100
    averaging: float = 0.0
    seed: int = 0

    def __post_init__(self):
        require_plan_settings(self)
        require_positive_integer(self.n_points, "n_points")

    def plan(self, n_subjects: int) -> Plan:
        """The settings in steps instead of epochs, for a number of training subjects."""
        return Plan(
            self.n_epochs * n_subjects, self.validate_every * n_subjects, self.save_every, self.patience,
            self.learning_rate, self.schedule, self.averaging,
        )  # fmt: skip


def completed_groups(name: str, settings: Groups, kinds: Mapping[str, type]) -> Groups:
    """All settings of a system: the given ones, and defaults for the others.

    Parameters
    ----------
    name : str
        Of the system, for the messages.
    settings : dict
        By group, as in a YAML file.
    kinds : mapping
        The dataclass of each group. It checks the values.

    Raises
    ------
    ValueError
        If a setting is unknown, or a value is invalid.
    """
    known = {group: setting_names(kind) for group, kind in kinds.items()}
    given = checked_groups(settings, known, f"the configuration of {name}")
    try:
        return {group: dataclasses.asdict(kind(**given[group])) for group, kind in kinds.items()}
    except (ValueError, TypeError) as error:
        raise ValueError(f"the configuration of {name} is invalid: {error}") from error
