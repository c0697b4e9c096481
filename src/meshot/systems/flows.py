"""Architecture and training settings of a deformation network, as in a YAML file."""

import dataclasses
import hashlib
import os
from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

import numpy as np
import torch

from meshot.anatomy import HEMISPHERES, Hemisphere
from meshot.flow import integrate
from meshot.loss import SummedLoss, SurfaceLoss, loss_setting_names, surface_loss
from meshot.mesh import Mesh, simplified
from meshot.metrics import Surface
from meshot.model import N_STEPS, DeformationNetwork, ImageVelocity, require_small
from meshot.settings import Groups, checked_groups, setting_names
from meshot.systems.learning import FlowTrainingSettings, mean_distances, train_on_subjects
from meshot.systems.protocol import Example, ExampleSets, Part, Scan, SurfaceKey, SurfaceSystem
from meshot.train import Progress, Training, chosen_device, data_record, require_examples
from meshot.types import Tensor
from meshot.volume import Volume, sample_volume

NETWORK = {"width", "hidden", "n_scales", "size", "extent", "velocity_unit"}


@dataclasses.dataclass(frozen=True)
class DeformationSettings(FlowTrainingSettings):
    """Settings of the training of a deformation network: those of all trainings of flows, with other defaults.

    Parameters
    ----------
    n_epochs, learning_rate, schedule, n_faces, n_flow_steps, method, validate_every, n_points
        See :class:`meshot.systems.LearningSettings` and
        :class:`meshot.systems.FlowTrainingSettings`.

    Raises
    ------
    ValueError
        If a number is outside its range or a name is unknown.
    """

    recorded_first = ("side", "n_epochs", "learning_rate", "schedule", "n_faces", "n_flow_steps", "method")

    n_epochs: int = 300
    learning_rate: float = 1e-4
    schedule: str = "constant"
    n_faces: int = 80_000
    n_flow_steps: int = N_STEPS
    method: str = "euler"
    validate_every: int = 1
    n_points: int = 20_000


@dataclasses.dataclass(frozen=True, eq=False)
class DeformationConfig:
    """Architecture, loss and training settings of a network: ``network``, ``loss`` and ``training`` in a file."""

    network: dict
    loss: SurfaceLoss | SummedLoss
    training: DeformationSettings

    def as_dict(self) -> Groups:
        """The settings as plain numbers and strings, for JSON."""
        return {
            "network": dict(self.network),
            "loss": self.loss.settings(),
            "training": self.training.as_dict(),
        }

    def new_network(self) -> DeformationNetwork:
        """The untrained network in float32. Its weights are determined by the seed."""
        return DeformationNetwork(**self.network, generator=self.training.seed).float()


def deformation_config(content: object, name: str = "the configuration") -> DeformationConfig:
    """Make a configuration from nested dictionaries, such as the content of a YAML file.

    Raises
    ------
    ValueError
        If a setting is unknown, or a value is invalid.
    """
    groups = checked_groups(content, _known(), name)
    try:
        config = DeformationConfig(
            groups["network"], surface_loss(groups["loss"]), DeformationSettings(**groups["training"])
        )
        config.new_network()
    except (ValueError, TypeError) as error:
        raise ValueError(f"{name} is invalid: {error}") from error
    return config


def _known() -> dict[str, set[str]]:
    return {"network": NETWORK, "loss": loss_setting_names(), "training": setting_names(DeformationSettings)}


# Application of a trained network: deformation of an initial surface by the flow.


def standardised(image: Volume, surface: Mesh) -> Volume:
    """An image scaled to mean 0 and standard deviation 1 over the vertices of a surface.

    In an image scaled to [0, 1], the border of white matter is a change of about 1/12 around a value of .6, which is
    small compared with the mean. Standardising removes the mean, and also gain and offset of the scanner.

    Parameters
    ----------
    image : Volume
    surface : Mesh
        In the space of the image.

    Raises
    ------
    ValueError
        If the image is constant over the surface, for example because they are in different spaces.
    """
    values = sample_volume(image, surface.vertices.double())
    mean, spread = float(values.mean()), float(values.std())
    if not spread > 0:
        raise ValueError(
            f"the image is {mean:.4g} at every vertex of the surface; are both in the same space, and is the scan a T1?"
        )
    return image.with_data(((image.data - mean) / spread).astype(np.float32))


def velocity_field(network: DeformationNetwork, image: Volume, surface: Mesh) -> ImageVelocity:
    """The velocity field of a network in an image that is standardised over a surface.

    It follows the network when its weights change.
    """
    path = "visited" if next(network.parameters()).device.type == "cpu" else "cut"
    return network.velocity_in(standardised(image, surface), path)


@torch.no_grad()
def deformed(
    initial: Mesh,
    image: Volume,
    network: DeformationNetwork,
    n_steps: int = N_STEPS,
    method: str = "euler",
    standard: Mesh | None = None,
) -> Mesh:
    """Deform an initial surface by the flow of a network in an image.

    Parameters
    ----------
    initial : Mesh
        In the space of the image, in mm. It may have any number of vertices, since the flow is defined everywhere.
    image : Volume
        On the standard grid. Its gain and offset do not matter, see :func:`meshot.systems.standardised`.
    network : DeformationNetwork
    n_steps, method : int, str
        See :func:`meshot.integrate`.
    standard : Mesh, optional
        The image is standardised over the vertices of this surface, by default those of ``initial``. For the coarse
        surface of a training it is the whole initial surface, as in the training.

    Returns
    -------
    Mesh
        With the faces, dtype and device of ``initial``.

    Raises
    ------
    ValueError
        As :func:`meshot.integrate` and :func:`meshot.systems.standardised`; or if the flow gives positions
        that are not finite.
    """
    parameter = next(network.parameters())
    start = initial.vertices.to(parameter)
    # Only the displacement is rounded to the network's precision, not the initial position.
    field = velocity_field(network, image, initial if standard is None else standard)
    moved = integrate(field, start, n_steps, method) - start
    if not bool(torch.isfinite(moved).all()):
        raise ValueError("the flow leads to vertices that are not finite: is the network trained?")
    return initial.with_vertices(initial.vertices + moved.to(initial.vertices))


# Training data of a deformation network: the initial and the true white surface of one hemisphere, and the scan.


@dataclasses.dataclass(frozen=True, eq=False)
class DeformationExample:
    """One hemisphere of one subject in the standard space, with meshes and scan in float32.

    Parameters
    ----------
    name : str
    scan : Volume
        On the standard grid, in [0, 1].
    initial : Mesh
        The initial surface.
    coarse : Mesh
        The initial surface with fewer faces, for training.
    target : Mesh
        The true white surface.
    """

    name: str
    scan: Volume
    initial: Mesh
    coarse: Mesh
    target: Mesh


def hemisphere_example(example: Example, side: Hemisphere, n_faces: int) -> DeformationExample:
    """Make an example of one hemisphere for training or validation.

    Parameters
    ----------
    example : Example
        With an initial white surface of that side.
    side : str
    n_faces : int
        Number of faces of the coarse surface.
    """
    key, image = (side, "white"), example.scan.image
    initial = example.scan.initial[key]
    return DeformationExample(
        example.name,
        image.with_data(image.data.astype(np.float32)),
        initial.to(torch.float32),
        simplified(initial, n_faces).to(torch.float32),
        example.targets[key].to(torch.float32),
    )


def digest(examples: Sequence[DeformationExample]) -> str:
    """The SHA-256 of the names and values of all examples, in their order."""
    total = hashlib.sha256()
    for item in examples:
        total.update(item.name.encode() + item.scan.data.tobytes())
        for mesh in (item.initial, item.coarse, item.target):
            total.update(mesh.vertices.numpy().tobytes() + mesh.faces.numpy().tobytes())
    return total.hexdigest()


# Algorithm 1 of the paper: training of a network whose flow moves initial surfaces to true ones.


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
        As :func:`meshot.systems.train_on_subjects`.

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


# Systems that deform initial white surfaces by flows, with one network per hemisphere.

_KEYS = tuple((side, "white") for side in HEMISPHERES)


class DeformationSystem(SurfaceSystem):
    """A system that deforms initial white surfaces. A subclass sets ``name`` and ``loss``.

    Attributes
    ----------
    loss : dict
        Default settings of the loss, in the format of ``loss`` in a YAML file.
    """

    surfaces = needs = _KEYS
    networks = {"_".join(key): DeformationNetwork for key in _KEYS}  # noqa: RUF012 (of the class, by the protocol)
    loss: ClassVar[dict] = {}

    @classmethod
    def config(cls, settings: Groups) -> DeformationConfig:
        """The settings as an object.

        Raises
        ------
        ValueError
            If a setting is unknown, a value is invalid, or the network is too large to be stored.
        """
        loss = cls._loss_settings(settings.get("loss", {}))
        config = deformation_config(settings | {"loss": loss}, f"the configuration of {cls.name}")
        require_small(config.new_network())
        return config

    @classmethod
    def _loss_settings(cls, given: dict) -> dict:
        """The given settings of the loss, with those defaults of the system that the loss and the encoding use."""
        chosen = {"terms", "loss", "encoding"} & given.keys()
        if "terms" in chosen or "terms" in cls.loss:
            return given if chosen else cls.loss | given
        names = {name: given.get(name) or cls.loss[name] for name in ("loss", "encoding")}
        return {k: v for k, v in cls.loss.items() if k in loss_setting_names(**names)} | names | given

    @classmethod
    def complete(cls, settings: Groups) -> Groups:
        """All settings with their defaults: see :class:`meshot.systems.DeformationConfig`."""
        return cls.config(settings).as_dict()

    @classmethod
    def train_parts(
        cls, examples: ExampleSets, settings: Groups, folder: Path | None, progress: Progress | None,
        device: torch.device | None,
    ) -> dict[str, Part]:  # fmt: skip
        """Train a network for the side in the settings, or for both sides, one after the other."""
        config, parts = cls.config(settings), {}
        for side in config.training.sides:
            name, training = f"{side}_white", dataclasses.replace(config.training, side=side)
            own = dataclasses.replace(config, training=training)
            sets = (
                [hemisphere_example(example, side, training.n_faces) for example in part]
                for part in (examples.training, examples.validation)
            )
            found = train_deformation(own, *sets, None if folder is None else folder / name, progress, device)
            parts[name] = Part(found.network, own.as_dict() | {"results": found.results()}, found.log)
        return parts

    def find_surfaces(self, scan: Scan) -> dict[SurfaceKey, Mesh]:
        """The initial surfaces moved by the flows, integrated with the settings of the training."""
        found = {}
        for key in self.surfaces:
            part = self.parts["_".join(key)]
            training = {"n_flow_steps": N_STEPS, "method": "euler"} | part.record.get("training", {})
            found[key] = deformed(
                scan.initial[key], scan.image, part.network, training["n_flow_steps"], training["method"]
            )
        return found


# DDOT, the system of the paper: flows trained with sliced Wasserstein distances between oriented varifolds.
#
# Le et al., *Diffeomorphic Mesh Deformation via Efficient Optimal Transport for Cortical Surface Reconstruction*, ICLR
# 2024.


class Ddot(DeformationSystem):
    """DDOT. The paper states no length of the scaled normals; 1 mm is one interpretation."""

    name = "ddot"
    loss = {"loss": "sliced", "encoding": "varifold", "normal_scale": 1.0}  # noqa: RUF012


# CortexODE: flows trained with squared Chamfer distances between sampled points.
#
# Ma et al., *CortexODE: Learning Cortical Surface Reconstruction by Neural ODEs*, IEEE Transactions on Medical Imaging,
# 2022. Initial surface, network and schedule are those of the other systems here. Only the loss differs.


class CortexOde(DeformationSystem):
    """CortexODE. The factor of the loss is that of the authors; it has almost no effect with Adam."""

    name = "cortexode"
    loss = {"loss": "chamfer", "encoding": "samples", "factor": 1000.0}  # noqa: RUF012


# Windows: flows trained with sliced transport in spatial windows. This system is ours; it is not in the paper.
#
# In windows of 6 mm, missing area does not affect vertices far away: see chapter 32. With the setting
# ``loss.last_window=3`` their radius falls to 3 mm during the training. The settings ``combined`` have the loss that
# chapter 39 chooses. With this loss the flows of the package are trained: see the settings ``shipped``.


class Windows(DeformationSystem):
    """Sliced Wasserstein distances between varifolds, in windows around positions of the target."""

    name = "windows"
    loss = {  # noqa: RUF012
        "loss": "windowed", "encoding": "varifold", "window": 6.0, "n_windows": 32, "n_directions": 16,
        "normal_scale": 8.0, "p": 1,
    }  # fmt: skip
