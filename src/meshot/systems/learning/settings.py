"""Settings that the trainings of systems share, and their completion from a file."""

import dataclasses
from collections.abc import Callable, Mapping
from typing import ClassVar

from torch import nn

from meshot.anatomy import HEMISPHERES, Hemisphere
from meshot.errors import require_choice, require_positive_integer
from meshot.flow import METHODS
from meshot.model import require_small
from meshot.train import Groups, Plan, checked_groups, plan_of_epochs, require_plan_settings, setting_names


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

    #: The settings that a record lists first. The others follow in the order of their declaration.
    recorded_first: ClassVar[tuple[str, ...]] = ()

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
        return plan_of_epochs(self, n_subjects)

    def as_dict(self) -> dict:
        """The settings by name, in the order of the records."""
        found = dataclasses.asdict(self)
        return {name: found[name] for name in self.recorded_first} | found


@dataclasses.dataclass(frozen=True)
class FlowTrainingSettings(LearningSettings):
    """Settings of the training of flows: those of all trainings, and the following.

    Parameters
    ----------
    side : str
        "left", "right" or "both". Each hemisphere has its own networks.
    n_faces : int
        Number of faces of the initial surface, or template, in training. A trained flow applies to surfaces of any
        size.
    n_flow_steps, method : int, str
        Integration of the flow: see :func:`meshot.integrate`.

    Raises
    ------
    ValueError
        If a number is outside its range or a name is unknown.
    """

    side: str = "both"
    n_faces: int = 20_480
    n_flow_steps: int = 30
    method: str = "rk4"

    def __post_init__(self):
        super().__post_init__()
        for name in ("n_faces", "n_flow_steps"):
            require_positive_integer(getattr(self, name), name)
        require_choice(self.side, "side", (*HEMISPHERES, "both"))
        require_choice(self.method, "method", METHODS)

    @property
    def sides(self) -> tuple[Hemisphere, ...]:
        """The hemispheres that are trained."""
        return HEMISPHERES if self.side == "both" else (self.side,)


def completed_groups(
    name: str,
    settings: Groups,
    kinds: Mapping[str, type],
    new_network: Callable[[Groups], nn.Module] | None = None,
) -> Groups:
    """All settings of a system: the given ones, and defaults for the others.

    Parameters
    ----------
    name : str
        Of the system, for the messages.
    settings : dict
        By group, as in a YAML file.
    kinds : mapping
        The dataclass of each group. It checks the values.
    new_network : callable of the completed settings, optional
        Creates a network of the system, such as the largest one.

    Raises
    ------
    ValueError
        If a setting is unknown, a value is invalid, or the network is too large to be stored.
    """
    known = {group: setting_names(kind) for group, kind in kinds.items()}
    given = checked_groups(settings, known, f"the configuration of {name}")
    try:
        found = {group: _as_dict(kind(**given[group])) for group, kind in kinds.items()}
        if new_network is not None:
            require_small(new_network(found))
    except (ValueError, TypeError) as error:
        raise ValueError(f"the configuration of {name} is invalid: {error}") from error
    return found


def _as_dict(settings: object) -> dict:
    found = settings.as_dict() if isinstance(settings, LearningSettings) else dataclasses.asdict(settings)
    return {name: list(value) if isinstance(value, tuple) else value for name, value in found.items()}  # as in a file
