"""Training of one network of a system, one subject a step, and the distances of its validation."""

import os
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np
from torch import nn

from meshot.mesh import Mesh
from meshot.metrics import Surface, average_surface_distance, hausdorff_distance, normal_agreement, offsets_between
from meshot.systems.examples import ExampleSets
from meshot.systems.learning.settings import LearningSettings
from meshot.systems.parts import Part
from meshot.train import Groups, Progress, Task, Training, examples_of_step, train_network
from meshot.types import Tensor

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
        Returns a line of the log with ``validation_loss``, such as :func:`meshot.systems.learning.mean_distances`.
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
    """Train a network on whole scans: see :func:`meshot.systems.learning.train_on_subjects`.

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
        As :func:`meshot.systems.learning.train_on_subjects`.
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
