"""Settings of CorticalFlow, as in a YAML file."""

import dataclasses
import math

from meshot.anatomy import HEMISPHERES, Hemisphere
from meshot.errors import require_positive_integer
from meshot.flow import METHODS
from meshot.systems.learning import LearningSettings


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
        if not 0 < self.velocity_unit < math.inf:
            raise ValueError(f"velocity_unit is {self.velocity_unit!r}; a positive length is needed, in mm")


@dataclasses.dataclass(frozen=True)
class ChainSettings(LearningSettings):
    """Settings of the training of every block: those of all trainings, and the following.

    Parameters
    ----------
    side : str
        "left", "right" or "both".
    n_faces : int
        Number of faces of the template in training.
    n_samples : int
        Number of points on each surface for the Chamfer loss.
    edge_weight : float
        Weight of the mean squared edge length (mm²), relative to the squared Chamfer loss (mm²).
    n_flow_steps, method : int, str
        Integration of the flow: see :func:`meshot.integrate`.

    Raises
    ------
    ValueError
        If a number is outside its range or a name is unknown.
    """

    side: str = "both"
    n_faces: int = 20_480
    n_samples: int = 10_000
    edge_weight: float = 0.1
    n_flow_steps: int = 30
    method: str = "rk4"

    def __post_init__(self):
        super().__post_init__()
        for name in ("n_faces", "n_samples", "n_flow_steps"):
            require_positive_integer(getattr(self, name), name)
        for name, known in (("side", (*HEMISPHERES, "both")), ("method", METHODS)):
            if getattr(self, name) not in known:
                raise ValueError(f"{name} is {getattr(self, name)!r}; one of {', '.join(known)} is needed")
        if not 0 <= self.edge_weight < math.inf:
            raise ValueError(f"edge_weight is {self.edge_weight!r}; a number >= 0 is needed")

    @property
    def sides(self) -> tuple[Hemisphere, ...]:
        """The hemispheres that are trained."""
        return HEMISPHERES if self.side == "both" else (self.side,)
