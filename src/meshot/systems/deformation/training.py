"""Algorithm 1 of the paper: a network learns flows from initial surfaces to true ones, through a loss of measures."""

import os
from collections.abc import Sequence

import numpy as np
import torch

from meshot.flow import integrate
from meshot.mesh import Mesh
from meshot.metrics import Surface, average_surface_distance, hausdorff_distance, normal_agreement, offsets_between
from meshot.model import DeformationNetwork
from meshot.systems.deformation.carrying import deformed, standardised
from meshot.systems.deformation.data import DeformationExample, digest
from meshot.systems.deformation.settings import DeformationConfig, DeformationSettings
from meshot.train import Progress, Task, Training, chosen_device, train_network
from meshot.types import Tensor

_ORDER, _LOSS = 0, 1  # streams of randomness


def train_deformation(
    config: DeformationConfig,
    training: Sequence[DeformationExample],
    validation: Sequence[DeformationExample],
    folder: str | os.PathLike | None = None,
    progress: Progress | None = None,
    device: torch.device | None = None,
) -> Training:
    """Train a network from its first weights, or go on where a stopped training was.

    Parameters
    ----------
    config : DeformationConfig
    training, validation : sequence of DeformationExample
        Of the side that the configuration names. The best network is that with the least mean ASSD in validation.
    folder : path, optional
        Where the state is saved (``training.safetensors``) and the log is kept (``log.jsonl``). If a state is there
        already, training goes on from it, and on one thread ends with the same weights as if it had never stopped.
    progress : callable of (steps done, steps in all, line of the log), optional
    device : torch.device, optional
        The accelerator if there is one, else the processor, if left out.

    Raises
    ------
    ValueError
        If there are no examples, or the folder holds a training of something else.
    FloatingPointError
        If the loss or a gradient is not finite; it names the step and the subject.

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

    def loss_of(step: int) -> tuple[Tensor, str]:
        item = _example(step, training, settings)
        generator = np.random.default_rng([settings.seed, _LOSS, step])
        predicted = carried(item.coarse.to(device), item, network, settings)
        try:
            return config.loss(predicted, item.target.to(device), generator), item.name
        except ValueError as error:  # such as a mesh that has lost its area
            raise FloatingPointError(
                f"the prediction of step {step} ({item.name}) carries no loss: {error}; lower the learning rate"
            ) from error

    return train_network(
        network, settings.plan(len(training)),
        Task(loss_of, lambda step: _validation(step, network, validation, targets, settings)),
        config.as_dict() | {"data": data}, folder, progress,
    )  # fmt: skip


def carried(mesh: Mesh, item: DeformationExample, network: DeformationNetwork, settings: DeformationSettings) -> Mesh:
    """The predicted mesh: every vertex at the end of its trajectory; differentiable in the network."""
    path = "visited" if mesh.vertices.device.type == "cpu" else "convolved"
    field = network.velocity_in(standardised(item.scan, item.initial), path)
    return mesh.with_vertices(integrate(field, mesh.vertices, settings.n_flow_steps, settings.method))


def _example(step: int, training: Sequence[DeformationExample], settings: DeformationSettings) -> DeformationExample:
    """The subject of a step: every epoch goes through all of them in a new order."""
    epoch, place = divmod(step, len(training))
    return training[np.random.default_rng([settings.seed, _ORDER, epoch]).permutation(len(training))[place]]


def _validation(
    step: int,
    network: DeformationNetwork,
    validation: Sequence[DeformationExample],
    targets: Sequence[Surface],
    settings: DeformationSettings,
) -> dict:
    """Means over the subjects, in mm of the standard space; the loss of the validation is the ASSD."""
    try:
        rows = [_distances(item, target, network, settings) for item, target in zip(validation, targets, strict=True)]
    except ValueError as error:  # such as a flow that leaves the finite numbers
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
