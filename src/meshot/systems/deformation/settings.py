"""How a deformation network is made and trained: the numbers, as a YAML file states them."""

import dataclasses

from meshot.anatomy import HEMISPHERES, Hemisphere
from meshot.errors import require_positive_integer
from meshot.flow import METHODS
from meshot.loss.composed import SurfaceLoss, loss_setting_names, surface_loss
from meshot.model import N_STEPS, DeformationNetwork
from meshot.train import Groups, Plan, checked_groups, require_plan_settings, setting_names

NETWORK = {"width", "hidden", "n_scales", "size", "extent"}


@dataclasses.dataclass(frozen=True)
class DeformationSettings:
    """How a deformation network is trained; one subject is one step.

    Parameters
    ----------
    side : str
        "left", "right" or "both": each hemisphere has its own network.
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
    averaging : float
        Of the weights: see :class:`meshot.train.Plan`.
    seed : int
        Of everything random; step i draws from (seed, i), so that a resumed training draws what it would have drawn.

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
        """The same in steps, for so many training subjects."""
        return Plan(
            self.n_epochs * n_subjects, self.validate_every * n_subjects, self.save_every, self.patience,
            self.learning_rate, self.schedule, self.averaging,
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
            "loss": self.loss.settings(),
            "training": dataclasses.asdict(self.training),
        }

    def new_network(self) -> DeformationNetwork:
        """The network before training, float32; its weights come from the seed."""
        return DeformationNetwork(**self.network, generator=self.training.seed).float()


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
            groups["network"], surface_loss(groups["loss"]), DeformationSettings(**groups["training"])
        )
        config.new_network()
    except (ValueError, TypeError) as error:
        raise ValueError(f"{name} will not do: {error}") from error
    return config


def _known() -> dict[str, set[str]]:
    return {"network": NETWORK, "loss": loss_setting_names(), "training": setting_names(DeformationSettings)}
