"""Training of one network of a system on whole scans, and the distances of its validation."""

from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
from torch import nn

from meshot.mesh import Mesh
from meshot.metrics import Surface, average_surface_distance, hausdorff_distance, normal_agreement, offsets_between
from meshot.systems.examples import ExampleSets
from meshot.systems.learning.settings import LearningSettings
from meshot.systems.protocol import Part
from meshot.train import Groups, Progress, Task, train_network
from meshot.types import Tensor

_ORDER, _LOSS = 0, 1  # random number streams


def train_part(
    network: nn.Module,
    settings: LearningSettings,
    examples: ExampleSets,
    loss_of: Callable[[int, np.random.Generator], Tensor],
    validate: Callable[[], dict],
    made_with: Groups,
    folder: Path | None = None,
    progress: Progress | None = None,
) -> Part:
    """Train a network, or resume a stopped training. One step uses one subject.

    Parameters
    ----------
    network : module
        Modified in place; at the end on the CPU, in its best state.
    settings : LearningSettings
    examples : ExampleSets
    loss_of : callable of (index of a training example, random numbers)
    validate : callable
        Returns a line of the log with ``validation_loss``, such as :func:`meshot.systems.learning.mean_distances`.
    made_with : dict
        The settings by group, and the description of the data under ``data``. The record of the part holds it.
    folder : path, optional
        For the state and the log.
    progress : callable of (steps done, number of steps, line of the log), optional

    Raises
    ------
    ValueError
        If the folder contains a different training.
    FloatingPointError
        If the loss or a gradient is not finite. The message names the step and the subject.
    """

    def loss_at(step: int) -> tuple[Tensor, str]:
        index = _example(step, len(examples.training), settings.seed)
        name = examples.training[index].name
        try:
            return loss_of(index, np.random.default_rng([settings.seed, _LOSS, step])), name
        except ValueError as error:  # for example a mesh without area
            raise FloatingPointError(
                f"the prediction of step {step} ({name}) has no loss: {error}; lower the learning rate"
            ) from error

    found = train_network(
        network, settings.plan(len(examples.training)), Task(loss_at, lambda _: validate()), made_with, folder, progress
    )
    record = {name: value for name, value in made_with.items() if name != "data"}
    return Part(found.network, record | {"results": found.results()}, found.log)


def _example(step: int, n_examples: int, seed: int) -> int:
    """The index of the subject of a step. Every epoch visits all subjects in a new random order."""
    epoch, place = divmod(step, n_examples)
    return int(np.random.default_rng([seed, _ORDER, epoch]).permutation(n_examples)[place])


def mean_distances(pairs: Iterable[tuple[Mesh, Surface]], n_points: int) -> dict:
    """Mean distances over pairs of a found and a true surface, in mm. The validation loss is the ASSD.

    Raises
    ------
    FloatingPointError
        If a found surface has no distance, for example because a position is not finite.
    """
    rows = []
    try:
        for mesh, target in pairs:
            there, back = offsets_between(Surface(mesh), target, n_points)
            rows.append(
                [average_surface_distance(there, back), hausdorff_distance(there, back), normal_agreement(there, back)]
            )
    except ValueError as error:
        raise FloatingPointError(
            f"a validation failed: {error}; lower the learning rate. The last saved state is whole"
        ) from error
    distance, farthest, normals = np.mean(rows, axis=0).tolist()
    return {"validation_loss": distance, "hausdorff90_mm": farthest, "normals": normals}
