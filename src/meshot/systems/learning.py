"""Common code of systems that learn: settings, templates, trainings and validation. Not a system."""

import dataclasses
import functools
import hashlib
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import ClassVar, Literal

import numpy as np
import torch
from torch import nn

from meshot.anatomy import HEMISPHERES, Hemisphere, fsaverage5_surface
from meshot.errors import require_choice, require_positive_integer
from meshot.flow import METHODS
from meshot.mesh import Mesh, icosphere, laplacian_smoothing, split_in_four
from meshot.metrics import Surface, average_surface_distance, hausdorff_distance, normal_agreement, offsets_between
from meshot.model import require_small
from meshot.settings import Groups, checked_groups, setting_names
from meshot.systems.protocol import Example, ExampleSets, Part, SurfaceKey
from meshot.train import (
    Plan,
    Progress,
    Task,
    Training,
    data_record,
    examples_of_step,
    plan_of_epochs,
    require_plan_settings,
    train_network,
)
from meshot.types import Float, Tensor
from meshot.volume import Volume

# Settings that the trainings of systems share, and their completion from a file.


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


# The surfaces that a training is for: the white ones of both sides, or the white and the pial ones.

#: The surfaces of a side that a system can find together.
SURFACES = (("white",), ("white", "pial"))


def checked_surfaces(surfaces: object) -> tuple[str, ...]:
    """The surfaces of a side as a tuple; YAML and JSON give a list.

    Raises
    ------
    ValueError
        If they are none of those that a system can find together.
    """
    if not isinstance(surfaces, list | tuple) or tuple(surfaces) not in SURFACES:
        raise ValueError(
            f"surfaces is {surfaces!r}; [white] or [white, pial] is needed: pial surfaces are found together with the "
            "white ones"
        )
    return tuple(surfaces)


def surfaces_of_sides(group: Mapping) -> tuple[SurfaceKey, ...]:
    """The surfaces of both sides that a group of settings names by ``surfaces``; white surfaces by default.

    Raises
    ------
    ValueError
        As :func:`checked_surfaces`.
    """
    kinds = checked_surfaces(group.get("surfaces", SURFACES[0]))
    return tuple((side, kind) for side in HEMISPHERES for kind in kinds)


# Scans as inputs of networks, and a description of the examples of a training.


def scaled_image(image: Volume) -> Float[Tensor, "1 1 x y z"]:
    """An image as input of a network, with mean 0 and standard deviation 1, in float32.

    Gain and offset of the scanner do not matter.

    Raises
    ------
    ValueError
        If the image is constant.
    """
    data = image.data.astype(np.float32)
    mean, spread = float(data.mean(dtype=np.float64)), float(data.std(dtype=np.float64))
    if not spread > 0:
        raise ValueError(f"the image is {mean:.4g} everywhere; a scan is needed")
    return torch.from_numpy((data - np.float32(mean)) / np.float32(spread))[None, None]


def example_data(sets: ExampleSets, keys: Sequence[SurfaceKey]) -> dict:
    """The number of examples for training and validation, and the SHA-256 of their scans and true surfaces."""
    return data_record(sets.training, sets.validation, lambda part: _digest(part, keys))


def _digest(examples: Sequence[Example], keys: Sequence[SurfaceKey]) -> str:
    total = hashlib.sha256()
    for item in examples:
        total.update(item.name.encode() + item.scan.image.data.astype(np.float32).tobytes())
        for key in keys:
            mesh = item.targets[key]
            total.update(mesh.vertices.double().numpy().tobytes() + mesh.faces.numpy().tobytes())
    return total.hexdigest()


# Template surfaces: one smooth closed shape, placed in the mean box of the training surfaces, and what it becomes.

SHAPES = ("fsaverage5", "sphere")
MOST_SMOOTHING, MOST_SPLITS = 2000, 3


@dataclasses.dataclass(frozen=True)
class TemplateSettings:
    """The shape of a template, and the surfaces that it becomes.

    Parameters
    ----------
    shape : str
        "fsaverage5": FreeSurfer's average white surface of other people, smoothed until its folds are gone. "sphere":
        an ellipsoid. Both have 10 242 vertices.
    smoothing : int
        Number of Laplacian steps on fsaverage5. After 200 steps the surface is a smooth hull of the hemisphere.
    splits : int
        How often every face is divided into four.
    surfaces : sequence of str
        The surfaces of each side that are found: [white], or [white, pial].

    Raises
    ------
    ValueError
        If the shape or the surfaces are unknown, or a count is outside its range.
    """

    shape: Literal["fsaverage5", "sphere"] = "fsaverage5"
    smoothing: int = 200
    splits: int = 0
    surfaces: Sequence[str] = SURFACES[0]

    def __post_init__(self):
        require_choice(self.shape, "shape", SHAPES)
        object.__setattr__(self, "surfaces", checked_surfaces(self.surfaces))
        for name, most in (("smoothing", MOST_SMOOTHING), ("splits", MOST_SPLITS)):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= most:
                raise ValueError(f"{name} is {value!r}; an integer from 0 to {most} is needed")


class Template(nn.Module):
    """A template in its position. Its box is a buffer, so that it is stored with the weights of the network.

    The box is the only property of training subjects that a template has. It is the mean of theirs, see
    :func:`meshot.systems.mean_box`. No subject of a test contributes to it.

    Parameters
    ----------
    side : str
        The hemisphere whose shape is used.
    settings : TemplateSettings
    box : tensor, optional
        The lower and the upper corner, in mm. By default the unit cube, until weights are loaded.
    """

    def __init__(self, side: Hemisphere, settings: TemplateSettings, box: Float[Tensor, "2 3"] | None = None):
        super().__init__()
        self.side, self.settings = side, settings
        box = torch.tensor([[0.0] * 3, [1.0] * 3]) if box is None else box
        self.register_buffer("box", box.float())

    def mesh(self) -> Mesh:
        """The template in mm, in float32: its bounding box is the box."""
        shape = template_shape(self.side, self.settings)
        low, high = shape.vertices.amin(dim=0), shape.vertices.amax(dim=0)
        lower, upper = self.box.double().cpu()
        return shape.with_vertices(lower + (shape.vertices - low) / (high - low) * (upper - lower)).to(torch.float32)


@functools.lru_cache(maxsize=8)
def template_shape(side: Hemisphere, settings: TemplateSettings) -> Mesh:
    """The shape of a template, before it is placed in its box."""
    if settings.shape == "sphere":
        return icosphere(5 + settings.splits)
    mesh = laplacian_smoothing(fsaverage5_surface("white", side), settings.smoothing)
    for _ in range(settings.splits):
        mesh = Mesh(*split_in_four(mesh.vertices, mesh.faces))
    return mesh


def mean_box(surfaces: Sequence[Mesh]) -> Float[Tensor, "2 3"]:
    """The mean of the bounding boxes of surfaces: the lower and the upper corner, in float32."""
    corners = [torch.stack([mesh.vertices.amin(dim=0), mesh.vertices.amax(dim=0)]).double() for mesh in surfaces]
    return torch.stack(corners).mean(dim=0).float()


# Training of one network of a system, one subject a step, and the distances of its validation.

_LOSS = 1  # random number stream; the order of the examples has stream 0


def train_on_subjects(
    network: nn.Module,
    settings: LearningSettings,
    names: Sequence[str],
    loss_of: Callable[[int, float, np.random.Generator], Tensor],
    validate: Callable[[], dict],
    made_with: Groups,
    folder: str | os.PathLike | None = None,
    progress: Progress | None = None,
) -> Training:
    """Train a network, or resume a stopped training. One step uses one subject.

    Parameters
    ----------
    network : module
        Modified in place; at the end on the CPU, in its best state.
    settings : LearningSettings
    names : sequence of str
        Of the training subjects.
    loss_of : callable of (index of a training subject, share of the steps that are done, random numbers)
    validate : callable
        Returns a line of the log with ``validation_loss``, such as :func:`meshot.systems.mean_distances`.
    made_with, folder, progress
        See :func:`meshot.train.train_network`.

    Raises
    ------
    ValueError
        If the folder contains a different training.
    FloatingPointError
        If the loss or a gradient is not finite, or ``loss_of`` or ``validate`` raises a ValueError. The message names
        the step, and the subject of a loss.
    """

    plan = settings.plan(len(names))

    def loss_at(step: int) -> tuple[Tensor, str]:
        (index,) = examples_of_step(step, len(names), settings.seed)
        draws = np.random.default_rng([settings.seed, _LOSS, step])
        try:
            return loss_of(index, step / plan.n_steps, draws), names[index]
        except ValueError as error:  # for example a mesh without area
            raise FloatingPointError(
                f"the prediction of step {step} ({names[index]}) has no loss: {error}; lower the learning rate"
            ) from error

    def validate_after(step: int) -> dict:
        try:
            return validate()
        except ValueError as error:  # for example positions that are not finite
            raise FloatingPointError(
                f"the validation after step {step} failed: {error}; lower the learning rate. The last saved state is "
                "whole"
            ) from error

    task = Task(loss_at, validate_after)
    return train_network(network, plan, task, made_with, folder, progress)


def train_part(
    network: nn.Module,
    settings: LearningSettings,
    examples: ExampleSets,
    loss_of: Callable[[int, float, np.random.Generator], Tensor],
    validate: Callable[[], dict],
    made_with: Groups,
    folder: Path | None = None,
    progress: Progress | None = None,
) -> Part:
    """Train a network on whole scans: see :func:`meshot.systems.train_on_subjects`.

    Parameters
    ----------
    network : module
        Modified in place; at the end on the CPU, in its best state.
    settings : LearningSettings
    examples : ExampleSets
    loss_of, validate : callable
    made_with : dict
        The settings by group, and the description of the data under ``data``. The record of the part holds it.
    folder, progress
        See :func:`meshot.train.train_network`.

    Raises
    ------
    ValueError, FloatingPointError
        As :func:`meshot.systems.train_on_subjects`.
    """
    names = [item.name for item in examples.training]
    found = train_on_subjects(network, settings, names, loss_of, validate, made_with, folder, progress)
    record = {name: value for name, value in made_with.items() if name != "data"}
    return Part(found.network, record | {"results": found.results()}, found.log)


def mean_distances(pairs: Iterable[tuple[Mesh, Surface]], n_points: int) -> dict:
    """Mean distances over pairs of a found and a true surface, in mm. The validation loss is the ASSD.

    Raises
    ------
    ValueError
        If a found surface has no distance, for example because a position is not finite.
    """
    rows = []
    for mesh, target in pairs:
        there, back = offsets_between(Surface(mesh), target, n_points)
        rows.append(
            [average_surface_distance(there, back), hausdorff_distance(there, back), normal_agreement(there, back)]
        )
    distance, farthest, normals = np.mean(rows, axis=0).tolist()
    return {"validation_loss": distance, "hausdorff90_mm": farthest, "normals": normals}
