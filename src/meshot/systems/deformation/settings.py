"""Architecture and training settings of a deformation network, as in a YAML file."""

import dataclasses

from meshot.loss.composed import SummedLoss, SurfaceLoss, loss_setting_names, surface_loss
from meshot.model import N_STEPS, DeformationNetwork
from meshot.systems.learning import FlowTrainingSettings
from meshot.train import Groups, checked_groups, setting_names

NETWORK = {"width", "hidden", "n_scales", "size", "extent", "velocity_unit"}


@dataclasses.dataclass(frozen=True)
class DeformationSettings(FlowTrainingSettings):
    """Settings of the training of a deformation network: those of all trainings of flows, with other defaults.

    Parameters
    ----------
    n_epochs, learning_rate, schedule, n_faces, n_flow_steps, method, validate_every, n_points
        See :class:`meshot.systems.learning.LearningSettings` and
        :class:`meshot.systems.learning.FlowTrainingSettings`.

    Raises
    ------
    ValueError
        If a number is outside its range or a name is unknown.
    """

    recorded_first = ("side", "n_epochs", "learning_rate", "schedule", "n_faces", "n_flow_steps", "method")

    n_epochs: int = 300
    learning_rate: float = 1e-4
    schedule: str = "constant"
    n_faces: int = 80_000
    n_flow_steps: int = N_STEPS
    method: str = "euler"
    validate_every: int = 1
    n_points: int = 20_000


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
            "training": self.training.as_dict(),
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
