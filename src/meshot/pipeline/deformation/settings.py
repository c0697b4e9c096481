"""How a deformation network is made and trained: the numbers, read from a YAML file."""

import dataclasses
import os
from collections.abc import Sequence

from meshot.anatomy import HEMISPHERES
from meshot.errors import require_positive_integer
from meshot.flow import METHODS
from meshot.loss import SurfaceLoss
from meshot.model import N_STEPS, DeformationNetwork
from meshot.train import Groups, Plan, changed_groups, checked_groups, read_groups, require_plan_settings, setting_names

NETWORK = {"width", "hidden", "n_scales", "size", "extent"}


@dataclasses.dataclass(frozen=True)
class DeformationSettings:
    """How a deformation network is trained; one subject is one step.

    Parameters
    ----------
    side : str
        "left" or "right": each hemisphere has its own network.
    n_epochs : int
        How often every training subject is seen.
    learning_rate, schedule
        Of Adam: see :class:`meshot.train.Plan`.
    n_faces : int
        Of the initial surface while training; afterwards the flow carries a surface of any size.
    n_flow_steps, method : int, str
        How the flow is integrated.
    validate_every, patience : int
        In epochs; stop after ``patience`` validations in a row without a lower distance (None: never).
    n_points : int
        On each surface, for the distance of the validation.
    save_every : int
        In steps.
    seed : int
        Of everything random; step i draws from (seed, i), so that a resumed training draws what it would have drawn.

    Raises
    ------
    ValueError
        If a number is outside its range or a name is unknown.
    """

    side: str = "left"
    n_epochs: int = 300
    learning_rate: float = 1e-4
    schedule: str = "constant"
    n_faces: int = 80_000
    n_flow_steps: int = N_STEPS
    method: str = "euler"
    validate_every: int = 1
    patience: int | None = None
    n_points: int = 20_000
    save_every: int = 100
    seed: int = 0

    def __post_init__(self):
        require_plan_settings(self)
        for name in ("n_faces", "n_flow_steps", "n_points"):
            require_positive_integer(getattr(self, name), name)
        for name, known in (("side", HEMISPHERES), ("method", METHODS)):
            if getattr(self, name) not in known:
                raise ValueError(f"{name} is {getattr(self, name)!r}; one of {', '.join(known)} is needed")

    def plan(self, n_subjects: int) -> Plan:
        """The same in steps, for so many training subjects."""
        return Plan(
            self.n_epochs * n_subjects, self.validate_every * n_subjects, self.save_every, self.patience,
            self.learning_rate, self.schedule,
        )  # fmt: skip


@dataclasses.dataclass(frozen=True, eq=False)
class DeformationConfig:
    """A network's form, its loss, and how it is trained: ``network``, ``loss`` and ``training`` of a file."""

    network: dict
    loss: SurfaceLoss
    training: DeformationSettings

    def as_dict(self) -> Groups:
        """Plain numbers and words, for JSON."""
        return {
            "network": dict(self.network),
            "loss": dataclasses.asdict(self.loss),
            "training": dataclasses.asdict(self.training),
        }

    def new_network(self) -> DeformationNetwork:
        """The network before training, float32; its weights come from the seed."""
        return DeformationNetwork(**self.network, generator=self.training.seed).float()


def read_deformation_config(path: str | os.PathLike, changes: Sequence[str] = ()) -> DeformationConfig:
    """Read a configuration; what it leaves out has the value of the paper, where the paper gives one.

    Parameters
    ----------
    path : path
    changes : sequence of str
        Such as ``loss.encoding=samples``, in place of what the file says.

    Raises
    ------
    ValueError
        If the file is missing or no YAML, names something unknown, or a value will not do.
    """
    return deformation_config(changed_groups(read_groups(path, _known()), changes), os.fspath(path))


def deformation_config(content: object, name: str = "the configuration") -> DeformationConfig:
    """A configuration from nested dictionaries, as they stand in a YAML file.

    Raises
    ------
    ValueError
        If it names something unknown, or a value will not do.
    """
    groups = checked_groups(content, _known(), name)
    try:
        config = DeformationConfig(
            groups["network"], SurfaceLoss(**groups["loss"]), DeformationSettings(**groups["training"])
        )
        config.new_network()
    except (ValueError, TypeError) as error:
        raise ValueError(f"{name} will not do: {error}") from error
    return config


def _known() -> dict[str, set[str]]:
    return {"network": NETWORK, "loss": setting_names(SurfaceLoss), "training": setting_names(DeformationSettings)}
