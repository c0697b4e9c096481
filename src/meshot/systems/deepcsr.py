"""DeepCSR: signed distances at points, from image features at several resolutions; surfaces by marching cubes.

As in the paper: an encoder whose maps at all resolutions, and one global vector, are read at every query point; a
decoder of residual blocks, whose normalisation is modulated by these features; one signed distance for each surface;
training with the absolute error at points near the surfaces and in space; a dense grid, smoothing, the largest
component, a correction of its topology, marching cubes. Ours is smaller: fewer and narrower levels, voxels of the image
folded in blocks, and the grid of the image (or half its spacing) in place of .5 mm. With the setting
``surface.surfaces: [white, pial]``, as in the paper, the network has a distance for each of the four surfaces; without
it, for the two white ones. Our decoder normalises each point alone in place of the batch, and our topology correction
is that of the initial surfaces here.

References: Santa Cruz et al., *DeepCSR: a 3D deep learning approach for cortical surface reconstruction*, WACV 2021.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Annotated

import numpy as np
import scipy.ndimage
import torch
from torch import nn

from meshot.errors import require_positive_integer
from meshot.mesh import Mesh, taubin_smoothing
from meshot.metrics import Surface, SurfaceSample
from meshot.model import FeatureNetwork, initialise, sample_features
from meshot.rng import Generator, numpy_generator
from meshot.settings import Count, Length, NotNegative, Settings, Within
from meshot.systems.learning import SURFACES, LearningSettings, Surfaces, of_both_sides, scaled_image, train_part
from meshot.systems.protocol import Example, ExampleSets, Part, Run, Scan, SurfaceKey, SurfaceSystem, listed
from meshot.types import Array, Float, Int64, Tensor
from meshot.volume import (
    Volume,
    cropped,
    enclosed_fractions,
    filled_cavities,
    genus_zero,
    isosurface,
    largest_component,
    mm_to_voxel,
    sample_volume,
    separated_field,
    voxel_sizes,
    voxel_to_mm,
)

# The network of DeepCSR: from a scan and points in mm to the signed distances of the points from surfaces.


@dataclasses.dataclass(frozen=True)
class NetworkSettings(Settings):
    """Architecture: see :class:`meshot.systems.deepcsr.DistanceNetwork`."""

    width: Count = 16
    depth: Count = 4
    fold: Count = 2
    hidden: Annotated[int, Within(1, 2048)] = 64
    n_blocks: Annotated[int, Within(1, 50)] = 5
    unit: Length = 5.0


class DistanceNetwork(nn.Module):
    """Signed distances (mm, negative inside) of points from several surfaces in one scan."""

    # ``width``, ``depth``, ``fold``: of the encoder: see :class:`meshot.model.FeatureNetwork`.
    # ``hidden``, ``n_blocks``: number of neurons, and of residual blocks, of the decoder.
    # ``unit``: in mm. The output of the last layer is multiplied by it.
    # ``generator``: source of the initial weights.

    def __init__(
        self,
        n_surfaces: int = 2,
        width: int = 16,
        depth: int = 4,
        fold: int = 2,
        hidden: int = 64,
        n_blocks: int = 5,
        unit: float = 5.0,
        generator: Generator = 0,
    ):
        super().__init__()
        require_positive_integer(n_surfaces, "n_surfaces", 8)
        own = NetworkSettings(width, depth, fold, hidden, n_blocks, unit)
        self.arguments, self.unit = {"n_surfaces": n_surfaces, **own.as_dict()}, float(unit)
        generator = numpy_generator(generator)
        self.encoder = FeatureNetwork(width, depth, fold, decoder=False, generator=generator)
        widths = self.encoder.widths
        self.of_whole = nn.Linear(widths[-1], widths[-1])
        self.of_position = nn.Linear(3, hidden)
        n_features = sum(widths) + widths[-1]
        self.blocks = nn.ModuleList(_Block(hidden, n_features) for _ in range(n_blocks))
        self.last = _Modulated(hidden, n_features)
        self.to_distance = nn.Linear(hidden, n_surfaces)
        for part in (self.of_whole, self.of_position, self.blocks, self.last, self.to_distance):
            initialise(part, generator)
        with torch.no_grad():  # every block begins as the identity, every modulation as none
            for block in self.blocks:
                block.second.weight.zero_()
            for layer in (each for each in self.modules() if isinstance(each, _Modulated)):
                layer.to_scale.weight.zero_()
                layer.to_shift.weight.zero_()

    def config(self) -> dict[str, int | float]:
        """The arguments that create a network of the same architecture."""
        return dict(self.arguments)

    def encode(self, image: Float[Tensor, "1 1 x y z"]) -> tuple[list[Tensor], Tensor]:
        """The maps of the encoder, and one vector for the whole image."""
        maps = self.encoder(image)
        return maps, nn.functional.relu(self.of_whole(maps[-1].mean(dim=(2, 3, 4))))

    def forward(
        self, maps: list[Tensor], whole: Float[Tensor, "1 g"], image: Volume, points: Float[Tensor, "n 3"]
    ) -> Float[Tensor, "n s"]:
        """The distances of points, in mm."""
        features = torch.cat([whole.expand(len(points), -1), sample_features(maps, image, points)], dim=1)
        places = 2 * (mm_to_voxel(image, points) + 0.5) / points.new_tensor(image.data.shape) - 1
        values = self.of_position(places)
        for block in self.blocks:
            values = block(values, features)
        return self.unit * self.to_distance(nn.functional.relu(self.last(values, features)))


class _Modulated(nn.Module):
    """Normalisation over the neurons of a point, then a scale and a shift that depend on the features."""

    def __init__(self, hidden: int, n_features: int):
        super().__init__()
        self.to_scale, self.to_shift = nn.Linear(n_features, hidden), nn.Linear(n_features, hidden)

    def forward(self, values: Tensor, features: Tensor) -> Tensor:
        normal = nn.functional.layer_norm(values, values.shape[1:])
        return (1 + self.to_scale(features)) * normal + self.to_shift(features)


class _Block(nn.Module):
    def __init__(self, hidden: int, n_features: int):
        super().__init__()
        self.before, self.between = _Modulated(hidden, n_features), _Modulated(hidden, n_features)
        self.first, self.second = nn.Linear(hidden, hidden), nn.Linear(hidden, hidden)

    def forward(self, values: Tensor, features: Tensor) -> Tensor:
        inner = self.first(nn.functional.relu(self.before(values, features)))
        return values + self.second(nn.functional.relu(self.between(inner, features)))


# From predicted distances to closed surfaces: a dense grid, smoothing, topology, marching cubes.

_CHUNK = 1 << 16
_BAND = 1.5  # in steps of the coarse grid: nearer to a surface, every voxel is evaluated
_MARGIN_VOXELS = 0.05


@dataclasses.dataclass(frozen=True)
class SurfaceSettings(Settings):
    """From distances to surfaces."""

    splits: Annotated[int, Within(1, 4)] = 1  # into how many parts the spacing of the image is divided along each axis
    blur: NotNegative = 0.5  # standard deviation of the Gaussian that smooths the distances, in voxels of the grid
    smoothing: Annotated[int, Within(0, 999)] = 5  # number of steps of Taubin smoothing of the surface
    surfaces: Surfaces = SURFACES[0]  # the surfaces of each side that are found: [white], or [white, pial]


@torch.no_grad()
def distance_grids(network: DistanceNetwork, image: Volume, splits: int = 1, every: int = 2) -> list[Volume]:
    """The predicted distances (mm, negative inside) on a grid over the image, one volume for each surface.

    The network is evaluated in every second voxel along each axis. Where it then expects a surface within three voxels,
    it is evaluated in every voxel. Elsewhere the distances are interpolated. The spacing of the image is divided into
    ``splits`` parts along each axis. With ``every`` 1, the network is evaluated in every voxel.
    """
    affine = image.affine.copy()
    affine[:3, :3] /= splits
    affine[:3, 3] += affine[:3, :3] @ np.full(3, (1 - splits) / 2)
    grid = Volume(np.zeros(np.array(image.data.shape) * splits, dtype=np.float32), affine)
    parameter = next(network.parameters())
    maps, whole = network.encode(scaled_image(image).to(parameter))

    def evaluated(voxels: Int64[Array, "n 3"]) -> Float[Array, "n s"]:
        parts = voxel_to_mm(grid, torch.from_numpy(voxels.astype(np.float32))).split(_CHUNK)
        return torch.cat([network(maps, whole, image, part.to(parameter)).cpu() for part in parts]).numpy()

    shape = grid.data.shape
    coarse = np.stack(np.meshgrid(*(np.arange(0, n, every) for n in shape), indexing="ij"), axis=-1)
    values = evaluated(coarse.reshape(-1, 3)).reshape(*coarse.shape[:3], -1)
    places = np.indices(shape) / every
    found = np.stack(
        [scipy.ndimage.map_coordinates(each, places, order=1, mode="nearest") for each in np.moveaxis(values, -1, 0)]
    )
    if every > 1:
        near = (np.abs(found) < _BAND * every * voxel_sizes(grid).max()).any(axis=0)
        if near.any():
            found[:, near] = evaluated(np.argwhere(near)).T
    return [grid.with_data(each) for each in found]


def closed_surface(distance: Volume, name: str, settings: SurfaceSettings) -> Mesh:
    """The zero level set of a distance, with the topology of a sphere."""
    # Steps: smoothing, the largest component of the inside, filled cavities, genus-0 correction by depth, marching
    # cubes, light smoothing.
    smooth = scipy.ndimage.gaussian_filter(distance.data, settings.blur) if settings.blur else distance.data
    depth = distance.with_data(-smooth)
    if not (depth.data > 0).any():
        raise ValueError(f"the network finds no inside of the surface {name}: is it trained, and is the scan a T1?")
    places = np.argwhere(largest_component(depth.data > 0))
    box = cropped(depth, voxel_to_mm(depth, torch.from_numpy(places).double()))
    mask = filled_cavities(largest_component(box.data > 0))
    ball = genus_zero(mask, box.data)
    margin = _MARGIN_VOXELS * float(voxel_sizes(box).min())
    return taubin_smoothing(isosurface(separated_field(box, ball, 0.0, margin), 0.0), settings.smoothing)


# Training of DeepCSR on the signed distances of random points.

_POOL = 2  # random number stream


@dataclasses.dataclass(frozen=True)
class DistanceSettings(LearningSettings):
    """Settings of the training: those of all trainings, and the following."""

    # number of points of each subject whose true distances are computed once, before the training
    n_pool: Count = 40_000
    n_samples: Count = 4096  # number of them in one step
    # nine tenths of the points are near the surfaces: points on them, displaced by normal random vectors with this
    # standard deviation (mm). The others are uniform in the image.
    spread: Length = 2.0
    largest: Length = 10.0  # distances beyond this one (mm) count as this one


@dataclasses.dataclass(frozen=True)
class DistanceGroups(Settings):
    """All settings."""

    network: NetworkSettings
    surface: SurfaceSettings
    training: DistanceSettings


@dataclasses.dataclass(frozen=True, eq=False)
class DistancePool:
    """Points in one scan (mm) and their true signed distances from every surface (mm, negative inside)."""

    points: Float[Tensor, "n 3"]
    distances: Float[Tensor, "n s"]


def distance_pool(
    example: Example, keys: Sequence[SurfaceKey], settings: DistanceSettings, draws: np.random.Generator
) -> DistancePool:
    """Random points near the surfaces and in the image, with their true distances."""
    # The distance to the faces is exact. Its sign is that of the enclosed fraction of the voxels, interpolated, minus
    # ½.
    image, surfaces = example.scan.image, [Surface(example.targets[key]) for key in keys]
    n_near = int(0.9 * settings.n_pool) // len(keys)
    near = [surface.sample(n_near, draws).points for surface in surfaces]
    near = [points + settings.spread * draws.standard_normal(points.shape) for points in near]
    places = draws.uniform(-0.5, np.array(image.data.shape) - 0.5, (settings.n_pool - n_near * len(keys), 3))
    points = np.concatenate([*near, voxel_to_mm(image, torch.from_numpy(places)).numpy()])
    columns = []
    for surface, key in zip(surfaces, keys):
        inside = image.with_data(enclosed_fractions(example.targets[key], image))
        fractions = sample_volume(inside, torch.from_numpy(points)).numpy()
        away = surface.offsets(SurfaceSample(points, np.zeros_like(points))).distances
        columns.append(np.where(fractions > 0.5, -away, away))
    distances = np.clip(np.stack(columns, axis=1), -settings.largest, settings.largest)
    return DistancePool(torch.from_numpy(points).float(), torch.from_numpy(distances).float())


class System(SurfaceSystem):
    """DeepCSR for the surfaces of both sides, with one network."""

    name = "deepcsr"
    groups = DistanceGroups
    networks = {"distances": DistanceNetwork}  # noqa: RUF012 (of the class, by the protocol)

    def __init__(self, parts: Mapping[str, Part]):
        super().__init__(parts)
        for part in parts.values():
            if part.network.arguments["n_surfaces"] != len(self.surfaces):
                raise ValueError(
                    f"the weights of {self.name} are for {part.network.arguments['n_surfaces']} surfaces, and their "
                    f"settings (surface.surfaces) name {listed(self.surfaces)}: take weights of a training with these "
                    "settings"
                )

    @classmethod
    def surfaces_of(cls, settings: DistanceGroups) -> tuple[SurfaceKey, ...]:
        """Those of ``surface.surfaces``, of both sides."""
        return of_both_sides(settings.surface.surfaces)

    @classmethod
    def new_networks(cls, settings: DistanceGroups) -> dict[str, DistanceNetwork]:
        """One network for all surfaces."""
        n_surfaces, seed = len(cls.surfaces_of(settings)), settings.training.seed
        return {"distances": DistanceNetwork(n_surfaces, **settings.network.as_dict(), generator=seed)}

    @classmethod
    def train_parts(cls, examples: ExampleSets, settings: DistanceGroups, run: Run) -> dict[str, Part]:
        """Train on the mean absolute error of the distances (mm). The network is validated on points of its own."""
        training, keys, network = settings.training, cls.surfaces_of(settings), run.networks["distances"].to(run.device)
        items = (*examples.training, *examples.validation)
        generators = [np.random.default_rng([training.seed, _POOL, index]) for index in range(len(items))]
        pools = [distance_pool(item, keys, training, draws) for item, draws in zip(items, generators)]
        values = [scaled_image(item.scan.image) for item in items]

        def error(index: int, chosen: Tensor | slice) -> Tensor:
            maps, whole = network.encode(values[index].to(run.device))
            points, truth = (part[chosen].to(run.device) for part in (pools[index].points, pools[index].distances))
            return (network(maps, whole, items[index].scan.image, points) - truth).abs().mean()

        def loss_of(index: int, _done: float, draws: np.random.Generator) -> Tensor:
            return error(index, torch.from_numpy(draws.integers(0, training.n_pool, training.n_samples)))

        @torch.no_grad()
        def validate() -> dict:
            found = [float(error(index, slice(None))) for index in range(len(examples.training), len(items))]
            return {"validation_loss": float(np.mean(found))}

        place = run.place("distances")
        return {"distances": train_part(network, settings, examples, keys, loss_of, validate, place, run.progress)}

    def find_surfaces(self, scan: Scan) -> dict[SurfaceKey, Mesh]:
        """The zero level sets of the predicted distances, after a correction of their topology."""
        settings = self.settings["distances"].surface
        grids = distance_grids(self.parts["distances"].network, scan.image, settings.splits)
        return {key: closed_surface(grid, " ".join(key), settings) for key, grid in zip(self.surfaces, grids)}
