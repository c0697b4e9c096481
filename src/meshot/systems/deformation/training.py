"""Algorithm 1 of the paper: training of a network whose flow moves initial surfaces to true ones."""

import os
from collections.abc import Sequence

import numpy as np
import torch

from meshot.flow import integrate
from meshot.mesh import Mesh
from meshot.metrics import Surface
from meshot.model import ImageVelocity
from meshot.systems.deformation.carrying import deformed, velocity_field
from meshot.systems.deformation.data import DeformationExample, digest
from meshot.systems.deformation.settings import DeformationConfig, DeformationSettings
from meshot.systems.learning import mean_distances, train_on_subjects
from meshot.train import Progress, Training, chosen_device, data_record, require_examples
from meshot.types import Tensor


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
        If there are no examples, the scan of a training example is constant over its surface, or the folder contains
        a different training.
    FloatingPointError
        As :func:`meshot.systems.learning.train_on_subjects`.

    References
    ----------
    Le et al., ICLR 2024, Algorithm 1.
    """
    require_examples(training, validation)
    settings, device = config.training, device or chosen_device()
    network = config.new_network().to(device)
    fields = [velocity_field(network, item.scan, item.initial) for item in training]
    targets = [Surface(item.target) for item in validation]

    def loss_of(index: int, done: float, draws: np.random.Generator) -> Tensor:
        item = training[index]
        predicted = carried(item.coarse.to(device), fields[index], settings)
        return config.loss.at(done)(predicted, item.target.to(device), draws)

    def validate() -> dict:
        flow = (settings.n_flow_steps, settings.method)
        found = (deformed(item.initial, item.scan, network, *flow) for item in validation)
        return mean_distances(zip(found, targets, strict=True), settings.n_points)

    names = [item.name for item in training]
    made_with = config.as_dict() | {"data": data_record(training, validation, digest)}
    return train_on_subjects(network, settings, names, loss_of, validate, made_with, folder, progress)


def carried(mesh: Mesh, field: ImageVelocity, settings: DeformationSettings) -> Mesh:
    """The predicted mesh: a mesh after the flow. Differentiable with respect to the network's parameters."""
    return mesh.with_vertices(integrate(field, mesh.vertices, settings.n_flow_steps, settings.method))
