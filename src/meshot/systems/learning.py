"""What systems that learn share: settings, templates, trainings and validation. Not a system."""

import dataclasses
import functools
import hashlib
import os
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
import torch
from torch import nn

from meshot.anatomy import HEMISPHERES, Hemisphere, fsaverage5_surface
from meshot.flow import METHODS
from meshot.mesh import Mesh, icosphere, laplacian_smoothing, split_in_four
from meshot.metrics import Surface, average_surface_distance, hausdorff_distance, normal_agreement, offsets_between
from meshot.settings import Count, Settings, Within, one_of
from meshot.systems.protocol import Example, ExampleSets, Part, SurfaceKey
from meshot.train import Progress, Task, Training, TrainingSettings, data_record, examples_of_step, train_network
from meshot.types import Float, Tensor
from meshot.volume import Volume

# Settings that the trainings of systems share, and the surfaces that a training is for.


@dataclasses.dataclass(frozen=True)
class LearningSettings(TrainingSettings):
    """Settings of a training in which one step uses one subject: those of all trainings, and the following.

    Parameters
    ----------
    n_points : int
        Number of points on each surface for the distance in validation.
    """

    n_points: Count = 10_000


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
    """

    side: Annotated[str, one_of((*HEMISPHERES, "both"))] = "both"
    n_faces: Count = 20_480
    n_flow_steps: Count = 30
    method: Annotated[str, one_of(METHODS)] = "rk4"

    @property
    def sides(self) -> tuple[Hemisphere, ...]:
        """The hemispheres that are trained."""
        return HEMISPHERES if self.side == "both" else (self.side,)


#: The surfaces of a side that a system can find together.
SURFACES = (("white",), ("white", "pial"))


def _found_together(surfaces: object, name: str) -> tuple[str, ...]:
    if not isinstance(surfaces, list | tuple) or tuple(surfaces) not in SURFACES:
        raise ValueError(
            f"{name} is {surfaces!r}; [white] or [white, pial] is needed: pial surfaces are found together with the "
            "white ones"
        )
    return tuple(surfaces)


#: The setting that names the surfaces of each side that are found.
Surfaces = Annotated[object, _found_together]


def of_both_sides(kinds: Sequence[str]) -> tuple[SurfaceKey, ...]:
    """The surfaces of these kinds of both sides."""
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

    def digest(examples: Sequence[Example]) -> str:
        total = hashlib.sha256()
        for item in examples:
            total.update(item.name.encode() + item.scan.image.data.astype(np.float32).tobytes())
            for mesh in (item.targets[key] for key in keys):
                total.update(mesh.vertices.double().numpy().tobytes() + mesh.faces.numpy().tobytes())
        return total.hexdigest()

    return data_record(sets.training, sets.validation, digest)


# Template surfaces: one smooth closed shape, placed in the mean box of the training surfaces, and what it becomes.


@dataclasses.dataclass(frozen=True)
class TemplateSettings(Settings):
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
    """

    shape: Annotated[str, one_of(("fsaverage5", "sphere"))] = "fsaverage5"
    smoothing: Annotated[int, Within(0, 2000)] = 200
    splits: Annotated[int, Within(0, 3)] = 0
    surfaces: Surfaces = SURFACES[0]


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
    made_with: dict,
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
    settings: Settings,
    examples: ExampleSets,
    keys: Sequence[SurfaceKey],
    loss_of: Callable[[int, float, np.random.Generator], Tensor],
    validate: Callable[[], dict],
    folder: Path | None = None,
    progress: Progress | None = None,
) -> Part:
    """Train a network on whole scans: see :func:`meshot.systems.train_on_subjects`.

    Parameters
    ----------
    network, loss_of, validate, folder, progress
        As there.
    settings : Settings
        All groups of the system. ``training`` are :class:`meshot.systems.LearningSettings`.
    examples : ExampleSets
    keys : sequence of keys
        The true surfaces that the network learns from.
    """
    names, record = [item.name for item in examples.training], settings.as_dict()
    made_with = record | {"data": example_data(examples, keys)}
    found = train_on_subjects(network, settings.training, names, loss_of, validate, made_with, folder, progress)
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
