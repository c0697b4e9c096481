"""How the segmentation network is trained: the numbers, read from a YAML file."""

import dataclasses
import math
import os
from collections.abc import Sequence
from pathlib import Path

from meshot.errors import require_positive_integer
from meshot.files import named_file
from meshot.model import SegmentationNetwork
from meshot.pipeline.segmentation.augmentation import Augmentation
from meshot.train import Plan, changed_groups, checked_groups, read_groups, require_plan_settings, setting_names

#: Where the configurations lie that come with the package.
SETTINGS = Path(__file__).parent
PRECISIONS = ("float32", "bfloat16")


@dataclasses.dataclass(frozen=True)
class SegmentationSettings:
    """How the segmentation network is trained.

    Parameters
    ----------
    n_epochs : int
        How often every training scan is seen.
    learning_rate : float
        Of Adam, at the start.
    schedule : str
        "constant", as in the paper, or "cosine": half a cosine from there to zero.
    batch_size : int
        Scans in one step.
    dice_weight : float
        Of the overlap beside the cross-entropy.
    soft_labels : bool
        Whether a voxel's target is the enclosed part of it, or which side its larger part is on.
    flip, shift, intensity, turn, stretch, bend
        How a training scan is changed: see :class:`meshot.pipeline.segmentation.augmentation.Augmentation`.
    reduction : int
        Voxels along each axis that are averaged into one before anything else.
    validate_every, patience : int
        In epochs; stop after ``patience`` validations in a row without a lower loss (None: never).
    save_every : int
        In steps.
    averaging : float
        Of the weights: see :class:`meshot.train.Plan`.
    seed : int
        Of everything random; step i draws from (seed, i), so that a resumed training draws what it would have drawn.
    precision : str
        "float32"; "bfloat16" convolves in half the bits, which is faster only where the processor has units for it.

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
        if self.precision not in PRECISIONS:
            raise ValueError(f"precision is {self.precision!r}; one of {', '.join(PRECISIONS)} is needed")

    def augmentation(self) -> Augmentation:
        """How a training scan is changed."""
        return Augmentation(self.flip, self.shift, self.intensity, self.turn, self.stretch, self.bend)

    def plan(self, n_examples: int) -> Plan:
        """The same in steps, for so many training scans."""
        per_epoch = -(-n_examples // self.batch_size)
        return Plan(
            self.n_epochs * per_epoch, self.validate_every * per_epoch, self.save_every, self.patience,
            self.learning_rate, self.schedule, self.averaging,
        )  # fmt: skip


@dataclasses.dataclass(frozen=True, eq=False)
class SegmentationConfig:
    """A network's form and how it is trained, as a YAML file states them under ``network`` and ``training``."""

    network: dict[str, int]
    training: SegmentationSettings

    def as_dict(self) -> dict:
        """Plain numbers and words, for JSON."""
        return {"network": dict(self.network), "training": dataclasses.asdict(self.training)}

    def new_network(self) -> SegmentationNetwork:
        """The network before training; its weights come from the seed."""
        return SegmentationNetwork(**self.network, generator=self.training.seed)


def read_segmentation_config(path: str | os.PathLike, changes: Sequence[str] = ()) -> SegmentationConfig:
    """Read a configuration; what it leaves out has the value of the paper, where the paper gives one.

    Parameters
    ----------
    path : path
        A YAML file, or the name of one that comes with the package: tiny, small, paper.
    changes : sequence of str
        Such as ``training.precision=bfloat16``, in place of what the file says.

    Raises
    ------
    ValueError
        If the file is missing or no YAML, names something unknown, or a value will not do.
    """
    return segmentation_config(changed_groups(read_groups(named_file(path, SETTINGS)), changes), os.fspath(path))


def segmentation_config(content: object, name: str = "the configuration") -> SegmentationConfig:
    """A configuration from nested dictionaries, as they stand in a YAML file.

    Raises
    ------
    ValueError
        If it names something unknown, or a value will not do.
    """
    groups = checked_groups(content, _KNOWN, name)
    try:
        config = SegmentationConfig(groups["network"], SegmentationSettings(**groups["training"]))
        config.new_network()
    except (ValueError, TypeError) as error:
        raise ValueError(f"{name} will not do: {error}") from error
    return config


_KNOWN = {"network": {"width", "depth", "fold"}, "training": setting_names(SegmentationSettings)}
