"""Settings of CorticalFlow, as in a YAML file."""

import dataclasses
import math

from meshot.errors import require_positive, require_positive_integer
from meshot.systems.learning import FlowTrainingSettings


@dataclasses.dataclass(frozen=True)
class FlowSettings:
    """Architecture of every block: see :class:`meshot.systems.corticalflow.blocks.FlowBlock`.

    Raises
    ------
    ValueError
        If the unit is not a positive number.
    """

    width: int = 8
    depth: int = 4
    fold: int = 2
    velocity_unit: float = 10.0

    def __post_init__(self):
        require_positive(self.velocity_unit, "velocity_unit", "mm")


@dataclasses.dataclass(frozen=True)
class ChainSettings(FlowTrainingSettings):
    """Settings of the training of every block: those of all trainings of flows, and the following.

    Parameters
    ----------
    n_samples : int
        Number of points on each surface for the Chamfer loss.
    edge_weight : float
        Weight of the mean squared edge length (mm²), relative to the squared Chamfer loss (mm²).

    Raises
    ------
    ValueError
        If a number is outside its range or a name is unknown.
    """

    recorded_first = (
        "n_epochs", "learning_rate", "schedule", "validate_every", "patience", "n_points", "save_every", "averaging",
        "seed", "side", "n_faces", "n_samples", "edge_weight",
    )  # fmt: skip

    n_samples: int = 10_000
    edge_weight: float = 0.1

    def __post_init__(self):
        super().__post_init__()
        require_positive_integer(self.n_samples, "n_samples")
        if not 0 <= self.edge_weight < math.inf:
            raise ValueError(f"edge_weight is {self.edge_weight!r}; a number >= 0 is needed")
