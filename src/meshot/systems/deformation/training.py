"""Algorithm 1 of the paper: training of a network whose flow moves initial surfaces to true ones."""

import functools
import os
from collections.abc import Sequence

import numpy as np
import torch

from meshot.flow import integrate
from meshot.mesh import Mesh
from meshot.metrics import Surface, average_surface_distance, hausdorff_distance, normal_agreement, offsets_between
from meshot.model import DeformationNetwork, ImageVelocity
from meshot.systems.deformation.carrying import deformed, standardised
from meshot.systems.deformation.data import DeformationExample, digest
from meshot.systems.deformation.settings import DeformationConfig, DeformationSettings
from meshot.train import Progress, Task, Training, chosen_device, train_network
from meshot.types import Tensor

_ORDER, _LOSS = 0, 1  # random number streams


def train_deformation(
    config: DeformationConfig,
    training: Sequence[DeformationExample],
    validation: Sequence[DeformationExample],
    folder: str | os.PathLike | None = None,
    progress: Progress | None = None,
    device: torch.device | None = None,
) -> Training:
    """Train a network from its initial weights, or resume a stopped training.

    Parameters
    ----------
    config : DeformationConfig
    training, validation : sequence of DeformationExample
        Of the side in the configuration. The best network is the one with the smallest mean ASSD in validation.
    folder : path, optional
        The folder for the state (``training.safetensors``) and the log (``log.jsonl``). If it contains a state, the
        training resumes from it. On one thread, the final weights are the same as without the interruption.
    progress : callable of (steps done, number of steps, line of the log), optional
    device : torch.device, optional
        By default the GPU if there is one, else the CPU.

    Raises
    ------
    ValueError
        If there are no examples, or the folder contains a different training.
    FloatingPointError
        If the loss or a gradient is not finite. The message names the step and the subject.

    References
    ----------
    Le et al., ICLR 2024, Algorithm 1.
    """
    if not training or not validation:
        raise ValueError(
            f"{len(training)} examples for training and {len(validation)} for validation came; at least one of each is "
            "needed"
        )
    settings, device = config.training, device or chosen_device()
    network = config.new_network().to(device)
    data = {
        name: {"n_scans": len(part), "sha256": digest(part)}
        for name, part in (("training", training), ("validation", validation))
    }
    targets = [Surface(item.target) for item in validation]

    @functools.cache
    def field_of(index: int) -> ImageVelocity:
        return velocity_field(training[index], network, device)

    def loss_of(step: int) -> tuple[Tensor, str]:
        index = _example(step, len(training), settings)
        item = training[index]
        generator = np.random.default_rng([settings.seed, _LOSS, step])
        predicted = carried(item.coarse.to(device), field_of(index), settings)
        try:
            return config.loss(predicted, item.target.to(device), generator), item.name
        except ValueError as error:  # for example a mesh without area
            raise FloatingPointError(
                f"the prediction of step {step} ({item.name}) has no loss: {error}; lower the learning rate"
            ) from error

    return train_network(
        network, settings.plan(len(training)),
        Task(loss_of, lambda step: _validation(step, network, validation, targets, settings)),
        config.as_dict() | {"data": data}, folder, progress,
    )  # fmt: skip


def velocity_field(item: DeformationExample, network: DeformationNetwork, device: torch.device) -> ImageVelocity:
    """The velocity field of a network in the scan of an example. It follows the network when its weights change."""
    path = "visited" if device.type == "cpu" else "convolved"
    return network.velocity_in(standardised(item.scan, item.initial), path)


def carried(mesh: Mesh, field: ImageVelocity, settings: DeformationSettings) -> Mesh:
    """The predicted mesh: a mesh after the flow. Differentiable with respect to the network's parameters."""
    return mesh.with_vertices(integrate(field, mesh.vertices, settings.n_flow_steps, settings.method))


def _example(step: int, n_examples: int, settings: DeformationSettings) -> int:
    """The index of the subject of a step. Every epoch visits all subjects in a new random order."""
    epoch, place = divmod(step, n_examples)
    return int(np.random.default_rng([settings.seed, _ORDER, epoch]).permutation(n_examples)[place])


def _validation(
    step: int,
    network: DeformationNetwork,
    validation: Sequence[DeformationExample],
    targets: Sequence[Surface],
    settings: DeformationSettings,
) -> dict:
    """Mean distances over the subjects, in mm of the standard space. The validation loss is the ASSD."""
    try:
        rows = [_distances(item, target, network, settings) for item, target in zip(validation, targets, strict=True)]
    except ValueError as error:  # for example positions that are not finite
        raise FloatingPointError(
            f"the validation after step {step} failed: {error}; lower the learning rate. The last saved state is whole"
        ) from error
    distance, farthest, normals = np.mean(rows, axis=0).tolist()
    return {"validation_loss": distance, "hausdorff90_mm": farthest, "normals": normals}


def _distances(
    item: DeformationExample, target: Surface, network: DeformationNetwork, settings: DeformationSettings
) -> list[float]:
    found = Surface(deformed(item.initial, item.scan, network, settings.n_flow_steps, settings.method))
    there, back = offsets_between(found, target, settings.n_points)
    return [average_surface_distance(there, back), hausdorff_distance(there, back), normal_agreement(there, back)]
