"""Settings of the training of the segmentation network, read from a YAML file."""

import dataclasses
import math
import os
from collections.abc import Sequence
from pathlib import Path

from meshot.errors import require_choice, require_positive_integer
from meshot.files import named_file
from meshot.model import SegmentationNetwork
from meshot.pipeline.segmentation.augmentation import Augmentation
from meshot.train import (
    Plan,
    changed_groups,
    checked_groups,
    plan_of_epochs,
    read_groups,
    require_plan_settings,
    setting_names,
)

#: The folder of the package's configurations.
SETTINGS = Path(__file__).parent
PRECISIONS = ("float32", "bfloat16")


@dataclasses.dataclass(frozen=True)
class SegmentationSettings:
    """Settings of the training of the segmentation network.

    Parameters
    ----------
    n_epochs : int
        Number of passes over all training scans.
    learning_rate : float
        Initial learning rate of Adam.
    schedule : str
        "constant", as in the paper, or "cosine": half a cosine to zero.
    batch_size : int
        Number of scans per step.
    dice_weight : float
        Weight of the overlap term relative to the cross-entropy.
    soft_labels : bool
        Whether the target of a voxel is its enclosed fraction, or this fraction rounded to 0 or 1.
    flip, shift, intensity, turn, stretch, shrink, contrast, bend
        The augmentation: see :class:`meshot.pipeline.segmentation.augmentation.Augmentation`.
    reduction : int
        Number of voxels along each axis that are averaged into one at the start.
    validate_every, patience : int
        In epochs. The training stops after ``patience`` consecutive validations without a lower loss (None: never).
    save_every : int
        In steps.
    averaging : float
        Averaging of the weights: see :class:`meshot.train.Plan`.
    seed : int
        Seed of all random numbers. Step i uses (seed, i), so that a resumed training draws the same numbers.
    precision : str
        "float32" or "bfloat16". The latter convolves in 16 bits, which is faster only on hardware that supports it.

    Raises
    ------
    ValueError
        If a number is outside its range or a name is unknown.
    """

    n_epochs: int = 100
    learning_rate: float = 1e-4
    schedule: str = "constant"
    batch_size: int = 1
    dice_weight: float = 1.0
    soft_labels: bool = True
    flip: float = 0.5
    shift: int = 4
    intensity: float = 0.2
    turn: float = 0.0
    stretch: float = 0.0
    shrink: float = 0.0
    contrast: float = 0.0
    bend: float = 0.0
    reduction: int = 1
    validate_every: int = 1
    patience: int | None = None
    save_every: int = 50
    averaging: float = 0.0
    seed: int = 0
    precision: str = "float32"

    def __post_init__(self):
        require_plan_settings(self)
        require_positive_integer(self.reduction, "reduction")
        if not 0 <= self.dice_weight < math.inf:
            raise ValueError(f"dice_weight is {self.dice_weight!r}; a finite number >= 0 is needed")
        self.augmentation()
        if not isinstance(self.soft_labels, bool):
            raise ValueError(f"soft_labels is {self.soft_labels!r}; true or false is needed")
        require_choice(self.precision, "precision", PRECISIONS)

    def augmentation(self) -> Augmentation:
        """The augmentation settings as an object."""
        names = [field.name for field in dataclasses.fields(Augmentation)]
        return Augmentation(**{name: getattr(self, name) for name in names})

    def plan(self, n_examples: int) -> Plan:
        """The settings in steps instead of epochs, for a number of training scans."""
        return plan_of_epochs(self, n_examples)


@dataclasses.dataclass(frozen=True, eq=False)
class SegmentationConfig:
    """Architecture and training settings of a network: ``network`` and ``training`` in a YAML file."""

    network: dict[str, int | str]
    training: SegmentationSettings

    def as_dict(self) -> dict:
        """The settings as plain numbers and strings, for JSON."""
        return {"network": dict(self.network), "training": dataclasses.asdict(self.training)}

    def new_network(self) -> SegmentationNetwork:
        """The untrained network. Its weights are determined by the seed."""
        return SegmentationNetwork(**self.network, generator=self.training.seed)


def read_segmentation_config(path: str | os.PathLike, changes: Sequence[str] = ()) -> SegmentationConfig:
    """Read a configuration. Missing settings have the paper's value, if the paper gives one.

    Parameters
    ----------
    path : path
        A YAML file, or the name of a configuration in the package: tiny, small, people, paper.
    changes : sequence of str
        Settings that replace those of the file, such as ``training.precision=bfloat16``.

    Raises
    ------
    ValueError
        If the file is missing or not YAML, a setting is unknown, or a value is invalid.
    """
    return segmentation_config(changed_groups(read_groups(named_file(path, SETTINGS)), changes), os.fspath(path))


def segmentation_config(content: object, name: str = "the configuration") -> SegmentationConfig:
    """Make a configuration from nested dictionaries, such as the content of a YAML file.

    Raises
    ------
    ValueError
        If a setting is unknown, or a value is invalid.
    """
    groups = checked_groups(content, _KNOWN, name)
    try:
        config = SegmentationConfig(groups["network"], SegmentationSettings(**groups["training"]))
        config.new_network()
    except (ValueError, TypeError) as error:
        raise ValueError(f"{name} is invalid: {error}") from error
    return config


_KNOWN = {"network": {"width", "depth", "fold", "placement"}, "training": setting_names(SegmentationSettings)}
