"""Segmentation of the white matter of both hemispheres: data, training, application, initial surfaces."""

import contextlib
import copy
import dataclasses
import hashlib
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
import torch
from scipy.spatial.transform import Rotation
from torch.nn.functional import grid_sample, interpolate
from tqdm import tqdm

from meshot.anatomy import HEMISPHERES, Hemisphere
from meshot.errors import require_positive_integer
from meshot.files import named_file
from meshot.mesh import Mesh
from meshot.model import (
    SegmentationNetwork,
    network_digest,
    read_weights,
    require_small,
    segmentation_loss,
    write_weights,
)
from meshot.pipeline.initial_surface import SegmentedSurface, segmented_surface
from meshot.pipeline.training_files import (
    STATE_FOLDER,
    WEIGHTS,
    placement_of,
    run_watched_training,
    scans_of,
    shown_command,
    whole_record,
    write_record,
)
from meshot.provenance import provenance
from meshot.rng import Generator, numpy_generator
from meshot.settings import Count, NotNegative, PartialSettings, Positive, Settings, Share, Within, one_of, read_groups
from meshot.train import (
    SCHEDULES,
    Progress,
    Task,
    Training,
    TrainingSettings,
    chosen_device,
    data_record,
    examples_of_step,
    require_examples,
    train_network,
)
from meshot.types import PLACEMENTS, Array, Float, Tensor
from meshot.volume import StandardScan, Volume, dice, enclosed_fractions

# Random augmentation of training scans: rotation, scaling, deformation, reflection, translation, intensity.

_BEND_NODES = 8  # control nodes along each axis
_BIAS_NODES = 4
_FIRST_SHARE = 0.5  # of scans as the first registration leaves them


@dataclasses.dataclass(frozen=True)
class Augmentation(Settings):
    """Ranges of the random augmentation of a training scan."""

    flip: Share = 0.5  # probability, in [0, 1], of a reflection that exchanges left and right
    shift: Annotated[int, Within(0, 10_000)] = 4  # maximum translation along each axis, in voxels
    # maximum relative change of contrast (gamma) and brightness, in [0, 1)
    intensity: Annotated[float, Within(0, 1, "[)")] = 0.2
    turn: NotNegative = 0.0  # maximum rotation about each axis, in degrees
    stretch: Annotated[float, Within(0, 1, "[)")] = 0.0  # maximum relative scaling along each axis, in [0, 1)
    # in half of the cases, the largest relative reduction of all axes together, in [0, 1). A first registration may
    # make a head with its skull this much too small.
    shrink: Annotated[float, Within(0, 1, "[)")] = 0.0
    # in the same cases, the largest change of the logarithm of the exponent gamma; a smooth bias field with a quarter
    # of it as its largest logarithm. The contrast is adjusted only after the first registration.
    contrast: NotNegative = 0.0
    bend: NotNegative = 0.0  # standard deviation of a smooth displacement, in voxels


def augmented(
    image: Float[Tensor, "1 x y z"], fractions: Float[Tensor, "2 x y z"], generator: Generator, by: Augmentation
) -> tuple[Float[Tensor, "1 x y z"], Float[Tensor, "2 x y z"]]:
    """Apply the same random augmentation to a scan and to its true fractions."""
    # A reflection of the first axis also exchanges the two maps, because a left hemisphere becomes a right one. Voxels
    # that enter at a border are zero.
    generator = numpy_generator(generator)
    mirror, moves = generator.random() < by.flip, generator.integers(-by.shift, by.shift + 1, 3).tolist()
    gamma, gain = 1 + by.intensity * generator.uniform(-1, 1, 2)
    image = (gain * image.clamp(min=0) ** gamma).clamp(max=1)
    first = (by.shrink > 0 or by.contrast > 0) and generator.random() < _FIRST_SHARE
    if first and by.contrast:  # another gamma, and a bias field, as in a scan before its contrast is adjusted
        gamma, span = float(np.exp(by.contrast * generator.uniform(-1, 1))), by.contrast / 4
        nodes = torch.from_numpy(generator.uniform(-span, span, (1, 1, *(_BIAS_NODES,) * 3))).to(image)
        bias = interpolate(nodes, size=tuple(image.shape[1:]), mode="trilinear", align_corners=True)[0]
        image = (image**gamma * bias.exp()).clamp(max=1)
    values = torch.cat([image, fractions])
    if by.turn or by.stretch or by.shrink or by.bend:
        # Rotate, scale and deform about the centre of the grid, in voxels.
        shape = values.shape[1:]
        turned = Rotation.from_euler("xyz", generator.uniform(-by.turn, by.turn, 3), degrees=True).as_matrix()
        matrix = turned * (1 + by.stretch * generator.uniform(-1, 1, 3))
        if first:
            matrix /= 1 - by.shrink * generator.random()
        axes = [torch.arange(n, dtype=values.dtype) - (n - 1) / 2 for n in shape]
        places = torch.stack(torch.meshgrid(*axes, indexing="ij"), dim=-1) @ torch.from_numpy(matrix).to(values).T
        nodes = torch.from_numpy(generator.normal(scale=by.bend, size=(1, 3, *(_BEND_NODES,) * 3))).to(values)
        bends = interpolate(nodes, size=tuple(shape), mode="trilinear", align_corners=True)[0].movedim(0, -1)
        # grid_sample expects the last axis first, and coordinates from -1 to 1 between the outermost voxels.
        halves = values.new_tensor([max(n - 1, 1) / 2 for n in shape])
        values = grid_sample(values[None], ((places + bends) / halves).flip(-1)[None], align_corners=True)[0]
    if mirror:
        values = values.flip(1)[[0, 2, 1]]
    for axis, move in enumerate(moves, start=1):
        values, n = values.roll(move, dims=axis), values.shape[axis]
        entered = min(abs(move), n)
        values.narrow(axis, 0 if move > 0 else n - entered, entered).zero_()
    return values[:1], values[1:]


# Settings of the training of the segmentation network, read from a YAML file.

#: The folder of the package's configurations.
SETTINGS = Path(__file__).parent / "settings"


@dataclasses.dataclass(frozen=True)
class SegmentationSettings(Augmentation, TrainingSettings):
    """Settings of the training of the segmentation network: those of all trainings, the augmentation, and these."""

    # learning_rate, schedule, validate_every, save_every: see :class:`meshot.train.TrainingSettings`
    learning_rate: Positive = 1e-4
    schedule: Annotated[str, one_of(SCHEDULES)] = "constant"
    validate_every: Count = 1
    save_every: Count = 50
    batch_size: Count = 1  # number of scans per step
    dice_weight: NotNegative = 1.0  # weight of the overlap term relative to the cross-entropy
    # whether the target of a voxel is its enclosed fraction, or this fraction rounded to 0 or 1
    soft_labels: bool = True
    reduction: Count = 1  # number of voxels along each axis that are averaged into one at the start
    # "float32" or "bfloat16". The latter convolves in 16 bits, which is faster only on hardware that supports it.
    precision: Annotated[str, one_of(("float32", "bfloat16"))] = "float32"


@dataclasses.dataclass(frozen=True)
class SegmentationNetworkSettings(PartialSettings):
    """Architecture: see :class:`meshot.model.SegmentationNetwork`, which has the defaults."""

    width: Annotated[int, Within(1, 512)] | None = None
    depth: Annotated[int, Within(1, 10)] | None = None
    fold: Annotated[int, Within(1, 8)] | None = None
    placement: Annotated[str, one_of(PLACEMENTS)] | None = None


@dataclasses.dataclass(frozen=True)
class SegmentationConfig(Settings):
    """All settings: the groups ``network`` and ``training`` of a file."""

    network: SegmentationNetworkSettings
    training: SegmentationSettings

    def new_network(self) -> SegmentationNetwork:
        """The untrained network. Its weights are determined by the seed."""
        return SegmentationNetwork(**self.network.as_dict(), generator=self.training.seed)


def read_segmentation_config(path: str | os.PathLike, changes: Sequence[str] = ()) -> SegmentationConfig:
    """Read a configuration. Missing settings have the paper's value, if the paper gives one."""
    return SegmentationConfig.read(read_groups(named_file(path, SETTINGS), changes), os.fspath(path))


# Training data of the segmentation network: standard scans, and the white-matter fraction of every voxel.

_IMAGE_LEVELS, _FRACTION_LEVELS = 65535, 255


@dataclasses.dataclass(frozen=True, eq=False)
class Example:
    """A scan and its true fractions, quantised to 4 bytes per voxel so that a cohort fits into memory.

    Parameters
    ----------
    name : str
    image : array
        uint16, where 65535 means 1.
    fractions : array
        uint8, for left and right. 255 is a voxel entirely inside the white surface.
    """

    name: str
    image: Array
    fractions: Array

    def tensors(self, soft: bool = True) -> tuple[Float[Tensor, "1 x y z"], Float[Tensor, "2 x y z"]]:
        """Image and fractions as float32. Unless ``soft``, each fraction is rounded to 0 or 1."""
        fractions = torch.from_numpy(self.fractions).float() / _FRACTION_LEVELS
        image = torch.from_numpy(self.image.astype(np.float32) / _IMAGE_LEVELS)
        return image[None], fractions if soft else (fractions > 0.5).float()


def example(name: str, scan: Volume, white: Mapping[str, Mesh], reduction: int = 1) -> Example:
    """Make an example from a standard scan and the true white surfaces in the same space.

    Parameters
    ----------
    name : str
    scan : Volume
        Values in [0, 1].
    white : mapping
        "left" and "right": closed, oriented outwards, in mm, in the space of the scan.
    reduction : int
        Number of voxels along each axis that are averaged into one.

    Raises
    ------
    ValueError
        If values are outside [0, 1], a side is missing, the size of an axis is not a multiple of ``reduction``, or a
        surface lies outside the scan.
    """
    if set(white) != set(HEMISPHERES):
        raise ValueError(f"white holds {sorted(white)}; one surface each for left and right is needed")
    if scan.data.min() < 0 or scan.data.max() > 1:
        raise ValueError(
            f"the scan of {name} ranges from {scan.data.min():.4g} to {scan.data.max():.4g}; values in [0, 1] are "
            "needed: bring it to the standard grid first"
        )
    fractions = np.stack([enclosed_fractions(white[side], scan) for side in HEMISPHERES])
    empty = [side for side, part in zip(HEMISPHERES, fractions) if not part.any()]
    if empty:
        raise ValueError(
            f"no voxel of the scan of {name} lies in its {empty[0]} white surface: are both in the same space?"
        )
    image = np.rint(block_means(scan.data, reduction) * _IMAGE_LEVELS).astype(np.uint16)
    parts = np.stack([block_means(part, reduction) for part in fractions])
    return Example(name, image, np.rint(parts * _FRACTION_LEVELS).astype(np.uint8))


def block_means(data: Array, reduction: int) -> Float[Array, "i j k"]:
    """The means over blocks of ``reduction³`` voxels."""
    require_positive_integer(reduction, "reduction")
    if any(n % reduction for n in data.shape):
        raise ValueError(f"the volume has {data.shape} voxels; every axis must be a multiple of {reduction}")
    i, j, k = (n // reduction for n in data.shape)
    blocks = np.asarray(data, dtype=np.float64).reshape(i, reduction, j, reduction, k, reduction)
    return blocks.mean(axis=(1, 3, 5))


def reduced_volume(volume: Volume, reduction: int) -> Volume:
    """A volume with coarser voxels, each the mean of ``reduction³`` voxels, at the same position in world space."""
    affine = volume.affine.copy()
    affine[:3, 3] += affine[:3, :3] @ np.full(3, (reduction - 1) / 2)
    affine[:3, :3] *= reduction
    return Volume(block_means(volume.data, reduction), affine)


def read_examples(
    cohorts: Sequence[str | os.PathLike], split: str, reduction: int = 1, progress: Callable[[list], Iterable] = iter
) -> list[Example]:
    """Read the examples of all scans of a split, from one or more cohorts on disk."""
    return [
        example(
            f"{subject.cohort.name}/{subject.name}",
            subject.standard().volume,
            {side: subject.surface("white", side, "standard") for side in HEMISPHERES},
            reduction,
        )
        for subject in progress(scans_of(cohorts, split))
    ]


def digest(examples: Sequence[Example]) -> str:
    """The SHA-256 of the names and values of all examples, in their order."""
    total = hashlib.sha256()
    for item in examples:
        total.update(item.name.encode() + str(item.image.shape).encode())
        total.update(item.image.tobytes() + item.fractions.tobytes())
    return total.hexdigest()


# Training of the segmentation network with Adam on overlap and cross-entropy, with validation and resumption.

_AUGMENTATION = 1  # random number stream; the order of the examples has stream 0


def train_segmentation(
    config: SegmentationConfig,
    training: Sequence[Example],
    validation: Sequence[Example],
    folder: str | os.PathLike | None = None,
    progress: Progress | None = None,
    device: torch.device | None = None,
    start: SegmentationNetwork | None = None,
    network: SegmentationNetwork | None = None,
) -> Training:
    """Train a network from its initial weights, or resume a stopped training.

    Parameters
    ----------
    config : SegmentationConfig
    training, validation : sequence of Example
        All on grids of the same size.
    folder : path, optional
        The folder for the state (``training.safetensors``) and the log (``log.jsonl``). If it contains a state, the
        training resumes from it. On one thread, the final weights are the same as without the interruption.
    progress : callable of (steps done, number of steps, line of the log), optional
    device : torch.device, optional
        By default the GPU if there is one, else the CPU.
    start : SegmentationNetwork, optional
        The training starts from the weights of this network, which stays as it is. By default they are random.
    network : SegmentationNetwork, optional
        From ``first_network``, which this function calls otherwise. It is trained.

    Raises
    ------
    ValueError
        If there are no examples, their grids differ, ``start`` has another architecture than the configuration, or the
        folder contains a different training.
    FloatingPointError
        If the loss or a gradient is not finite. The message names the step and the scans.
    """
    require_examples(training, validation)
    shapes = {item.image.shape for item in (*training, *validation)}
    if len(shapes) != 1:
        raise ValueError(f"the examples are on grids {sorted(shapes)}; all must be on one grid: bring them to it")
    settings, device = config.training, device or chosen_device()
    network = (network or first_network(config, start)).to(device)

    def loss_of(step: int) -> tuple[Tensor, str]:
        names, image, fractions = _batch(step, training, settings)
        return _loss(network, image.to(device), fractions.to(device), settings)[0], ", ".join(names)

    made_with = config.as_dict() | {"data": data_record(training, validation, digest)}
    made_with |= {} if start is None else {"start_sha256": network_digest(start)}
    return train_network(
        network,
        settings.plan(len(training)),
        Task(loss_of, lambda _: _validation(network, validation, settings, device)),
        made_with,
        folder,
        progress,
    )


def first_network(config: SegmentationConfig, start: SegmentationNetwork | None) -> SegmentationNetwork:
    """The network before the first step: untrained, or a copy of ``start``."""
    network = config.new_network()
    if start is None:
        return network
    has, needed = ({"placement": PLACEMENTS[0]} | each.config() for each in (start, network))
    for name in needed:
        if has[name] != needed[name]:
            by_cohort = "cohorts that were made with that placement (meshot make-cohort --standard)"
            remedy = by_cohort if name == "placement" else f"--set network.{name}={has[name]}"
            raise ValueError(
                f"the network to start from has {name} {has[name]!r}, and this training has {needed[name]!r}: take "
                f"{remedy}, or start from another network"
            )
    return copy.deepcopy(start)


def _batch(
    step: int, training: Sequence[Example], settings: SegmentationSettings
) -> tuple[list[str], Float[Tensor, "b 1 x y z"], Float[Tensor, "b 2 x y z"]]:
    """Names, images and fractions of one step."""
    chosen = [training[i] for i in examples_of_step(step, len(training), settings.seed, settings.batch_size)]
    generator = np.random.default_rng([settings.seed, _AUGMENTATION, step])
    pairs = [augmented(*item.tensors(settings.soft_labels), generator, settings) for item in chosen]
    images, fractions = (torch.stack(part) for part in zip(*pairs))
    return [item.name for item in chosen], images, fractions


def _loss(
    network: SegmentationNetwork, image: Tensor, fractions: Tensor, settings: SegmentationSettings
) -> tuple[Tensor, Tensor]:
    short = settings.precision == "bfloat16"
    with torch.autocast(image.device.type, torch.bfloat16) if short else contextlib.nullcontext():
        logits = network(image)
    logits = logits.float()
    return segmentation_loss(logits, fractions, settings.dice_weight), logits


@torch.no_grad()
def _validation(
    network: SegmentationNetwork, validation: Sequence[Example], settings: SegmentationSettings, device: torch.device
) -> dict:
    """Mean loss and Dice over the validation scans."""
    losses, overlaps = [], []
    for item in validation:
        image, fractions = (part[None].to(device) for part in item.tensors(settings.soft_labels))
        loss, logits = _loss(network, image, fractions, settings)
        found = (torch.softmax(logits, dim=1)[0, 1:] > 0.5).cpu().numpy()
        truth = (fractions[0] > 0.5).cpu().numpy()
        losses.append(float(loss))
        overlaps.append([dice(a, b) for a, b in zip(found, truth)])
    left, right = np.mean(overlaps, axis=0).tolist()
    return {"validation_loss": float(np.mean(losses)), "dice_left": left, "dice_right": right}


# Training of the segmentation network from a configuration, with output files.

#: The base name of the output files.
NAME = "segmentation"


def run_segmentation_training(
    config_path: str | os.PathLike,
    cohorts: Sequence[str | os.PathLike],
    folder: str | os.PathLike,
    changes: Sequence[str] = (),
    device: torch.device | None = None,
    start: str | os.PathLike | None = None,
) -> Training:
    """Train on the cohorts with a configuration, show a progress bar, and write the output files.

    Parameters
    ----------
    config_path : path
        A YAML file, or the name of a configuration in the package, such as "small".
    cohorts : sequence of path
    folder : path
        The folder for ``segmentation.safetensors``, its record ``segmentation.json``, its log
        ``segmentation.log.jsonl`` and the picture of the log ``segmentation.png``. A stopped training resumes from
        ``state/``.
    changes : sequence of str
        Settings that replace those of the configuration, such as ``training.precision=bfloat16``.
    device : torch.device, optional
        By default the GPU if there is one, else the CPU.
    start : path, optional
        The training starts from the weights in this file, to adapt a trained network to other scans. By default they
        are random. The record has their digest as ``start_sha256``.

    Raises
    ------
    ValueError
        If the configuration, a cohort, the folder or the file of ``start`` is invalid, its network has another
        architecture, or the network is too large to be stored.
    """
    folder, config, made = Path(folder), read_segmentation_config(config_path, changes), provenance()
    placement = placement_of(cohorts)
    if placement != PLACEMENTS[0]:
        config = dataclasses.replace(config, network=dataclasses.replace(config.network, placement=placement))
    first = None if start is None else read_weights(start, SegmentationNetwork)[0]
    network = first_network(config, first)
    require_small(network)
    training, validation = (
        read_examples(cohorts, split, config.training.reduction, lambda found, s=split: tqdm(found, desc=f"read {s}"))
        for split in ("train", "validation")
    )
    found = run_watched_training(
        folder,
        made,
        lambda report: train_segmentation(
            config, training, validation, folder / STATE_FOLDER, report, device, first, network
        ),
    )
    command = shown_command("train-segmentation", config_path, cohorts, folder, changes, device=device, start=start)
    origin = {} if first is None else {"start_sha256": network_digest(first)}
    record = whole_record(folder, config.as_dict(), found.results() | origin, command, cohorts)
    write_weights(folder / f"{NAME}{WEIGHTS}", found.network, record)
    write_record(folder, NAME, record, found.log)
    return found


# White-matter probabilities from a standard scan, and initial surfaces from these probabilities.


@torch.no_grad()
def segment(scan: Volume, network: SegmentationNetwork) -> dict[Hemisphere, Volume]:
    """The probability of white matter of each side, on the grid of the scan.

    The scan is in [0, 1], on the standard grid, or on the coarser grid on which the network was trained.

    Raises
    ------
    ValueError
        If values are outside [0, 1], or the grid does not suit the network.
    """
    low, high = float(scan.data.min()), float(scan.data.max())
    if low < 0 or high > 1 or low == high:
        raise ValueError(
            f"the scan ranges from {low:.4g} to {high:.4g}; the network needs a scan scaled to [0, 1]: bring it to the "
            "standard grid with standard_scan"
        )
    parameter = next(network.parameters())
    image = torch.as_tensor(scan.data.astype(np.float32), device=parameter.device)[None, None]
    probability = torch.softmax(network(image), dim=1)[0, 1:].cpu().numpy()
    return {side: scan.with_data(part) for side, part in zip(HEMISPHERES, probability, strict=True)}


def require_white_matter(found: dict[Hemisphere, Volume]) -> dict[Hemisphere, Volume]:
    """The probabilities of white matter, after a check that some was found on both sides."""
    for side, probability in found.items():
        if not (probability.data > 0.5).any():
            raise ValueError(
                f"the network finds no white matter on the {side}: is the scan a T1, upright, and is the network "
                "trained?"
            )
    return found


def initial_surfaces(scan: StandardScan, network: SegmentationNetwork) -> dict[Hemisphere, SegmentedSurface]:
    """The initial white surfaces of both hemispheres in the standard space, with intermediate results."""
    found = require_white_matter(segment(scan.volume, network))
    return {side: segmented_surface(probability) for side, probability in found.items()}


def in_scanner(mesh: Mesh, scan: StandardScan) -> Mesh:
    """A mesh of the standard space in scanner RAS of the original scan, in mm, with outward normals."""
    moved = mesh.with_vertices(scan.to_scanner(mesh.vertices))
    return moved if np.linalg.det(scan.to_standard) > 0 else Mesh(moved.vertices, moved.faces.flip(1))
