"""Training of DeepCSR on the signed distances of random points."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch

from meshot.errors import require_positive, require_positive_integer
from meshot.mesh import Mesh
from meshot.metrics import Surface, SurfaceSample
from meshot.systems.deepcsr.network import DistanceNetwork
from meshot.systems.examples import Example, ExampleSets, SurfaceKey
from meshot.systems.learning import LearningSettings, example_data, scaled_image, train_part
from meshot.systems.parts import Part
from meshot.train import Groups, Progress, chosen_device
from meshot.types import Array, Float, Tensor
from meshot.volume import sample_volume, voxel_to_mm
from meshot.volume.surfaces import enclosed_fractions

_POOL = 2  # random number stream


@dataclasses.dataclass(frozen=True)
class DistanceSettings(LearningSettings):
    """Settings of the training: those of all trainings, and the following.

    Parameters
    ----------
    n_pool : int
        Number of points of each subject whose true distances are computed once, before the training.
    n_samples : int
        Number of them in one step.
    spread : float
        Nine tenths of the points are near the surfaces: points on them, displaced by normal random vectors with this
        standard deviation (mm). The others are uniform in the image.
    largest : float
        Distances beyond this one (mm) count as this one.

    Raises
    ------
    ValueError
        If a number is outside its range.
    """

    n_pool: int = 40_000
    n_samples: int = 4096
    spread: float = 2.0
    largest: float = 10.0

    def __post_init__(self):
        super().__post_init__()
        for name in ("n_pool", "n_samples"):
            require_positive_integer(getattr(self, name), name)
        for name in ("spread", "largest"):
            require_positive(getattr(self, name), name, "mm")


@dataclasses.dataclass(frozen=True, eq=False)
class DistancePool:
    """Points in one scan (mm) and their true signed distances from every surface (mm, negative inside)."""

    points: Float[Tensor, "n 3"]
    distances: Float[Tensor, "n s"]


def distance_pool(
    example: Example, keys: Sequence[SurfaceKey], settings: DistanceSettings, draws: np.random.Generator
) -> DistancePool:
    """Random points near the surfaces and in the image, with their true distances.

    The distance to the faces is exact. Its sign is that of the enclosed fraction of the voxels, interpolated, minus ½.

    Raises
    ------
    ValueError
        If a true surface is not closed.
    """
    image, surfaces = example.scan.image, [Surface(example.targets[key]) for key in keys]
    n_near = int(0.9 * settings.n_pool) // len(keys)
    near = [surface.sample(n_near, draws).points for surface in surfaces]
    near = [points + settings.spread * draws.standard_normal(points.shape) for points in near]
    places = draws.uniform(-0.5, np.array(image.data.shape) - 0.5, (settings.n_pool - n_near * len(keys), 3))
    points = np.concatenate([*near, voxel_to_mm(image, torch.from_numpy(places)).numpy()])
    columns = [_signed(surface, example.targets[key], points, example) for surface, key in zip(surfaces, keys)]
    distances = np.clip(np.stack(columns, axis=1), -settings.largest, settings.largest)
    return DistancePool(torch.from_numpy(points).float(), torch.from_numpy(distances).float())


def _signed(surface: Surface, mesh: Mesh, points: Float[Array, "n 3"], example: Example) -> Float[Array, " n"]:
    inside = example.scan.image.with_data(enclosed_fractions(mesh, example.scan.image))
    fractions = sample_volume(inside, torch.from_numpy(points)).numpy()
    distances = surface.offsets(SurfaceSample(points, np.zeros_like(points))).distances
    return np.where(fractions > 0.5, -distances, distances)


def train_distances(
    keys: Sequence[SurfaceKey],
    examples: ExampleSets,
    settings: Groups,
    folder: Path | None = None,
    progress: Progress | None = None,
    device: torch.device | None = None,
) -> Part:
    """Train the network on the mean absolute error of the distances. It is validated on points of its own (mm).

    Parameters
    ----------
    keys : sequence of keys
        The surfaces, in the order of the network's outputs.
    examples : ExampleSets
    settings : dict
        Complete: the groups ``network``, ``surface`` and ``training``.
    folder, progress, device
        As :meth:`meshot.systems.SurfaceSystem.train`.

    Raises
    ------
    ValueError, FloatingPointError
        As :func:`meshot.systems.learning.train_part`.
    """
    training, device = DistanceSettings(**settings["training"]), device or chosen_device()
    network = DistanceNetwork(len(keys), **settings["network"], generator=training.seed).to(device)
    items = (*examples.training, *examples.validation)
    generators = [np.random.default_rng([training.seed, _POOL, index]) for index in range(len(items))]
    pools = [distance_pool(item, keys, training, draws) for item, draws in zip(items, generators)]
    values = [scaled_image(item.scan.image) for item in items]

    def error(index: int, chosen: Tensor | slice) -> Tensor:
        maps, whole = network.encode(values[index].to(device))
        points, truth = (part[chosen].to(device) for part in (pools[index].points, pools[index].distances))
        return (network(maps, whole, items[index].scan.image, points) - truth).abs().mean()

    def loss_of(index: int, _done: float, draws: np.random.Generator) -> Tensor:
        return error(index, torch.from_numpy(draws.integers(0, training.n_pool, training.n_samples)))

    def validate() -> dict:
        with torch.no_grad():
            found = [float(error(index, slice(None))) for index in range(len(examples.training), len(items))]
        return {"validation_loss": float(np.mean(found))}

    made_with = settings | {"data": example_data(examples, keys)}
    return train_part(network, training, examples, loss_of, validate, made_with, folder, progress)
