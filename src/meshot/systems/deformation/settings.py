"""Architecture and training settings of a deformation network, as in a YAML file."""

import dataclasses

from meshot.anatomy import HEMISPHERES, Hemisphere
from meshot.errors import require_positive_integer
from meshot.flow import METHODS
from meshot.loss.composed import SummedLoss, SurfaceLoss, loss_setting_names, surface_loss
from meshot.model import N_STEPS, DeformationNetwork
from meshot.train import Groups, Plan, checked_groups, require_plan_settings, setting_names

NETWORK = {"width", "hidden", "n_scales", "size", "extent", "velocity_unit"}


@dataclasses.dataclass(frozen=True)
class DeformationSettings:
    """Settings of the training of a deformation network. One step uses one subject.

    Parameters
    ----------
    side : str
        "left", "right" or "both". Each hemisphere has its own network.
    n_epochs : int
        Number of passes over all training subjects.
    learning_rate, schedule
        Of Adam: see :class:`meshot.train.Plan`.
    n_faces : int
        Number of faces of the initial surface in training. The trained flow applies to surfaces of any size.
    n_flow_steps, method : int, str
        Integration of the flow: see :func:`meshot.integrate`.
    validate_every, patience : int
        In epochs. The training stops after ``patience`` consecutive validations without a lower distance (None: never).
    n_points : int
        Number of points on each surface for the distance in validation.
    save_every : int
        In steps.
    averaging : float
        Averaging of the weights: see :class:`meshot.train.Plan`.
    seed : int
        Seed of all random numbers. Step i uses (seed, i), so that a resumed training draws the same numbers.

    Raises
    ------
    ValueError
        If a number is outside its range or a name is unknown.
    """

    side: str = "both"
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
    averaging: float = 0.0
    seed: int = 0

    def __post_init__(self):
        require_plan_settings(self)
        for name in ("n_faces", "n_flow_steps", "n_points"):
            require_positive_integer(getattr(self, name), name)
        for name, known in (("side", (*HEMISPHERES, "both")), ("method", METHODS)):
            if getattr(self, name) not in known:
                raise ValueError(f"{name} is {getattr(self, name)!r}; one of {', '.join(known)} is needed")

    @property
    def sides(self) -> tuple[Hemisphere, ...]:
        """The hemispheres that are trained."""
        return HEMISPHERES if self.side == "both" else (self.side,)

    def plan(self, n_subjects: int) -> Plan:
        """The settings in steps instead of epochs, for a number of training subjects."""
        return Plan(
            self.n_epochs * n_subjects, self.validate_every * n_subjects, self.save_every, self.patience,
            self.learning_rate, self.schedule, self.averaging,
        )  # fmt: skip


@dataclasses.dataclass(frozen=True, eq=False)
class DeformationConfig:
    """Architecture, loss and training settings of a network: ``network``, ``loss`` and ``training`` in a file."""

    network: dict
    loss: SurfaceLoss | SummedLoss
    training: DeformationSettings

    def as_dict(self) -> Groups:
        """The settings as plain numbers and strings, for JSON."""
        return {
            "network": dict(self.network),
            "loss": self.loss.settings(),
            "training": dataclasses.asdict(self.training),
        }

    def new_network(self) -> DeformationNetwork:
        """The untrained network in float32. Its weights are determined by the seed."""
        return DeformationNetwork(**self.network, generator=self.training.seed).float()


def deformation_config(content: object, name: str = "the configuration") -> DeformationConfig:
    """Make a configuration from nested dictionaries, such as the content of a YAML file.

    Raises
    ------
    ValueError
        If a setting is unknown, or a value is invalid.
    """
    groups = checked_groups(content, _known(), name)
    try:
        config = DeformationConfig(
            groups["network"], surface_loss(groups["loss"]), DeformationSettings(**groups["training"])
        )
        config.new_network()
    except (ValueError, TypeError) as error:
        raise ValueError(f"{name} is invalid: {error}") from error
    return config


def _known() -> dict[str, set[str]]:
    return {"network": NETWORK, "loss": loss_setting_names(), "training": setting_names(DeformationSettings)}
