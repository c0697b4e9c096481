"""Training of Vox2Cortex: segmentation and the meshes of all four stages, of all surfaces at once."""

import dataclasses
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import torch

from meshot.anatomy import HEMISPHERES, Hemisphere
from meshot.errors import require_positive_integer
from meshot.mesh import Mesh
from meshot.mesh.editing import simplified
from meshot.metrics import Surface
from meshot.model import segmentation_loss
from meshot.systems.examples import Example, ExampleSets
from meshot.systems.learning import (
    LearningSettings,
    example_data,
    mean_box,
    mean_distances,
    scaled_image,
    surfaces_of_sides,
    train_part,
)
from meshot.systems.parts import Part
from meshot.systems.vox2cortex.losses import MeshWeights, curved_target
from meshot.systems.vox2cortex.network import MeshNetwork, template_name
from meshot.train import Groups, Progress, chosen_device
from meshot.types import Float, Tensor
from meshot.volume.surfaces import enclosed_fractions


@dataclasses.dataclass(frozen=True)
class MeshSettings(LearningSettings):
    """Settings of the training: those of all trainings, and the following.

    Parameters
    ----------
    n_faces : int
        Number of faces of the templates in training.
    n_samples : int
        Number of points on each surface for the Chamfer distance.

    Raises
    ------
    ValueError
        If a number is outside its range.
    """

    n_faces: int = 20_480
    n_samples: int = 10_000

    def __post_init__(self):
        super().__post_init__()
        for name in ("n_faces", "n_samples"):
            require_positive_integer(getattr(self, name), name)


def train_meshes(
    examples: ExampleSets,
    settings: Groups,
    folder: Path | None = None,
    progress: Progress | None = None,
    device: torch.device | None = None,
) -> Part:
    """Train the network of all surfaces. It is validated on the meshes of the last stage.

    Parameters
    ----------
    examples : ExampleSets
    settings : dict
        Complete: the groups ``network``, ``template``, ``loss`` and ``training``.
    folder, progress, device
        As :meth:`meshot.systems.SurfaceSystem.train`.

    Raises
    ------
    ValueError, FloatingPointError
        As :func:`meshot.systems.learning.train_part`.
    """
    training, weights = MeshSettings(**settings["training"]), MeshWeights(**settings["loss"])
    device = device or chosen_device()
    keys = surfaces_of_sides(settings.get("template", {}))
    boxes = {template_name(key): mean_box([item.targets[key] for item in examples.training]) for key in keys}
    network = MeshNetwork(
        **settings["network"], template=settings["template"], boxes=boxes, generator=training.seed
    ).to(device)
    templates = {side: coarse_template(network, side, training.n_faces).to(device) for side in HEMISPHERES}
    truths = [{key: curved_target(item.targets[key].to(device)) for key in keys} for item in examples.training]
    fractions = [true_fractions(item) for item in examples.training]

    def loss_of(index: int, _done: float, draws: np.random.Generator) -> Tensor:
        image = examples.training[index].scan.image
        maps = network.unet(scaled_image(image).to(device))
        total = weights.segmentation * segmentation_loss(network.segmentation(maps), fractions[index].to(device))
        for side, template in templates.items():
            for found in network.surfaces_after(maps, image, template, side):
                for kind, mesh in found.items():
                    target = truths[index][side, kind]
                    total = total + weights.of(kind).mesh_loss(mesh, target, training.n_samples, draws)
        return total

    validate = _validation(network, templates, examples, training, device)
    made_with = settings | {"data": example_data(examples, keys)}
    return train_part(network, training, examples, loss_of, validate, made_with, folder, progress)


def _validation(
    network: MeshNetwork, templates: Mapping[Hemisphere, Mesh], examples: ExampleSets, training: MeshSettings,
    device: torch.device,
) -> Callable[[], dict]:  # fmt: skip
    surfaces = [{key: Surface(item.targets[key]) for key in network.surfaces} for item in examples.validation]

    @torch.no_grad()
    def validate() -> dict:
        pairs = []
        for item, truths in zip(examples.validation, surfaces, strict=True):
            maps = network.unet(scaled_image(item.scan.image).to(device))
            for side, template in templates.items():
                found = network.surfaces_after(maps, item.scan.image, template, side)[-1]
                pairs += [(mesh, truths[side, kind]) for kind, mesh in found.items()]
        return mean_distances(pairs, training.n_points)

    return validate


def coarse_template(network: MeshNetwork, side: Hemisphere, n_faces: int) -> Mesh:
    """The white template of one side with fewer faces, in float32."""
    return simplified(network.templates[side].mesh(), n_faces).to(torch.float32)


def true_fractions(example: Example) -> Float[Tensor, "1 2 x y z"]:
    """The fractions of every voxel that the true white surfaces of left and right enclose, in float32.

    Raises
    ------
    ValueError
        If a surface is not closed, or its normals point inwards.
    """
    found = [enclosed_fractions(example.targets[side, "white"], example.scan.image) for side in HEMISPHERES]
    return torch.from_numpy(np.stack(found).astype(np.float32))[None]
