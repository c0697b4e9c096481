"""A classical system: threshold of a bias-corrected scan, genus 0, marching cubes, a move to the intensity gradient.

It plays the part of FreeSurfer in the consistency table, and is not FreeSurfer. The steps are of the same kind: bias
correction, a threshold between grey and white matter, filling, a correction of the topology, a tessellation, and a
deformable surface that looks for the steepest decrease of intensity. Each step here is far simpler: no skull
stripping, no atlas labels, no cutting of brainstem and callosum beyond a mean region, no control of distances between
neighbouring walls. The training estimates one threshold, and the mean white matter of its subjects, which says where
to look. No network is trained.

References: Dale, Fischl and Sereno, *Cortical surface-based analysis I*, NeuroImage 1999.
"""

import dataclasses
import math
from collections.abc import Sequence
from typing import Annotated

import numpy as np
import scipy.ndimage
import torch
from torch import nn

from meshot.errors import require_positive_integer
from meshot.mesh import Mesh, taubin_smoothing, vertex_normals
from meshot.settings import Length, Positive, Settings, Share, Within
from meshot.systems.learning import LearningSettings, of_both_sides, train_part
from meshot.systems.protocol import Example, ExampleSets, Part, Run, Scan, SurfaceKey, SurfaceSystem
from meshot.types import Array, Bool, Float, Tensor
from meshot.volume import (
    Volume,
    cropped,
    enclosed_fractions,
    filled_cavities,
    genus_zero,
    isosurface,
    largest_component,
    sample_volume,
    separated_field,
    voxel_sizes,
    voxel_to_mm,
)

# What the classical system knows beforehand: where white matter may lie, and one threshold of the intensity.

_ANYWHERE = 0.01  # smallest mean fraction that counts as white matter of a side
_DEEP = 0.9  # mean fraction from which a voxel counts as deep white matter


class Atlas(nn.Module):
    """The mean white matter of both sides over the training subjects, on a coarse grid, and a threshold."""

    # ``shape``: number of voxels of a scan along each axis.
    # ``reduction``: number of voxels of a scan along each axis in one voxel of the atlas.
    # ``fractions``: the atlas: the mean fraction of every coarse voxel that the white surfaces of left and right
    # enclose. By default zero, until weights are loaded.
    # ``level``: the initial threshold, relative to the intensity of deep white matter.

    def __init__(
        self,
        shape: Sequence[int],
        reduction: int = 4,
        fractions: Float[Array, "2 i j k"] | None = None,
        level: float = 0.8,
    ):
        super().__init__()
        require_positive_integer(reduction, "reduction", 16)
        if len(shape) != 3 or any(n % reduction or n < 2 * reduction for n in shape):
            raise ValueError(f"the scans have {tuple(shape)} voxels; every axis must be a multiple of {reduction}")
        self.shape, self.reduction = tuple(int(n) for n in shape), reduction
        coarse = [n // reduction for n in self.shape]
        values = torch.zeros(2, *coarse) if fractions is None else torch.from_numpy(fractions).float()
        self.register_buffer("fractions", values)
        self.level = nn.Parameter(torch.tensor(float(level)))

    def config(self) -> dict:
        """The arguments that create an atlas of the same shape."""
        return {"shape": list(self.shape), "reduction": self.reduction}

    def on_grid(self, image: Volume) -> Float[Array, "2 x y z"]:
        """The mean fractions of left and right at every voxel of a scan, by trilinear interpolation."""
        if image.data.shape != self.shape:
            raise ValueError(
                f"the scan has {image.data.shape} voxels, those of the training {self.shape}; bring it to the standard "
                "grid with standard_scan"
            )
        fine = nn.functional.interpolate(self.fractions[None].cpu(), self.shape, mode="trilinear", align_corners=False)
        return fine[0].numpy()

    def allowed(self, image: Volume, margin: float) -> Bool[Array, "2 x y z"]:
        """Where white matter of left and right may lie: at most ``margin`` mm from where it was in some subject."""
        fractions = self.on_grid(image)
        near = [
            scipy.ndimage.distance_transform_edt(each < _ANYWHERE, sampling=voxel_sizes(image)) <= margin
            for each in fractions
        ]
        own = fractions[0] >= fractions[1]
        first, second = (scipy.ndimage.distance_transform_edt(~each) for each in near)
        nearer = np.where(fractions.max(axis=0) > 0, own, first <= second)
        return np.stack([near[0] & nearer, near[1] & ~nearer])

    def deep(self, image: Volume, share: float = _DEEP) -> Bool[Array, "2 x y z"]:
        """Where almost all subjects have white matter, or what a white surface encloses besides, such as ventricles."""
        fractions = self.on_grid(image)
        return fractions >= share * fractions.max(axis=(1, 2, 3), keepdims=True)


def mean_fractions(subjects: Sequence[tuple[Sequence[Mesh], Volume]], reduction: int) -> Float[Array, "2 i j k"]:
    """The mean over subjects of the fractions that their surfaces of left and right enclose, over blocks of voxels."""
    total = [
        np.stack([_blocks(enclosed_fractions(mesh, image), reduction) for mesh in both]) for both, image in subjects
    ]
    return np.mean(total, axis=0)


def _blocks(data: Float[Array, "x y z"], reduction: int) -> Float[Array, "i j k"]:
    if any(n % reduction for n in data.shape):
        raise ValueError(f"the scan has {data.shape} voxels; every axis must be a multiple of {reduction}")
    i, j, k = (n // reduction for n in data.shape)
    return data.reshape(i, reduction, j, reduction, k, reduction).mean(axis=(1, 3, 5))


def whiteness(image: Volume, deep: Bool[Array, "x y z"], width: float, n_rounds: int) -> Volume:
    """The scan with a smooth gain field removed, relative to the intensity of deep white matter, which is near 1."""
    # In every round, bright voxels (above .85) count as white matter. The mean of their logarithms under a Gaussian is
    # the logarithm of the gain. The method is a simple form of bias correction; N4 and FreeSurfer do more.
    middle = float(np.median(image.data[deep])) if deep.any() else 0.0
    if not middle > 0 or not math.isfinite(middle):
        raise ValueError(
            f"the median intensity in deep white matter is {middle:.4g}; a T1 on the standard grid is needed"
        )
    found, sigma = image.data.astype(np.float64) / middle, width / voxel_sizes(image)
    for _ in range(n_rounds):
        white = (found > 0.85) & (found < 1.3)
        weights = scipy.ndimage.gaussian_filter(white.astype(np.float64), sigma)
        logs = scipy.ndimage.gaussian_filter(np.where(white, np.log(np.maximum(found, 1e-6)), 0.0), sigma)
        found = found / np.exp(logs / np.maximum(weights, 1e-3))
        found = found / np.median(found[deep])
    return image.with_data(found)


def misfit(
    found: Float[Tensor, " n"], truth: Float[Tensor, " n"], level: Float[Tensor, ""], softness: float = 0.05
) -> Float[Tensor, ""]:
    """The mean squared difference between true fractions of voxels and a soft threshold of their whiteness."""
    return (torch.sigmoid((found - level) / softness) - truth).square().mean()


# From the whiteness of a scan to a closed surface: threshold, genus 0, marching cubes, a move to the steepest edge.

_MARGIN = 0.02  # of whiteness
_DEPTH_WEIGHT = 0.02  # of whiteness, per voxel
_INNERMOST = 0.15  # smallest change of the whiteness over the reach that counts as an edge


@dataclasses.dataclass(frozen=True)
class SurfaceSettings(Settings):
    """Regions, bias correction and deformation."""

    reduction: Annotated[int, Within(1, 16)] = 4  # see :class:`meshot.systems.classical.Atlas`
    margin: Length = 4.0  # in mm: how far white matter may lie from where it was in some training subject
    bias_width: Length = 20.0  # in mm: the standard deviation of the Gaussian of the bias correction
    # bias_rounds, smoothing, rounds: rounds of the bias correction; steps of Taubin smoothing of the first surface;
    # rounds of the deformation
    bias_rounds: Annotated[int, Within(0, 999)] = 2
    smoothing: Annotated[int, Within(0, 999)] = 5
    rounds: Annotated[int, Within(0, 999)] = 10
    # reach, rate: in every round, a vertex looks for the steepest decrease of intensity up to ``reach`` mm along its
    # normal, and moves ``rate`` of the way
    reach: Length = 1.5
    rate: Share = 0.3
    # of the whiteness at an edge: an edge counts less the more its whiteness differs from the threshold, by a Gaussian
    # of this standard deviation. Otherwise the outer border of a thin cortex would be taken for the inner.
    tolerance: Positive = 0.1


@dataclasses.dataclass(frozen=True)
class EdgeGroups(Settings):
    """All settings."""

    surface: SurfaceSettings
    training: LearningSettings


def thresholded_surface(
    white: Volume, level: float, allowed: Bool[Array, "x y z"], deep: Bool[Array, "x y z"], name: str
) -> Mesh:
    """The closed surface where the whiteness takes a level, within a region, with the topology of a sphere."""
    inside = (white.data > level) & allowed | deep
    if not inside.any():
        raise ValueError(f"no voxel is as bright as white matter for the surface {name}; is the scan a T1?")
    mask = largest_component(inside)
    places = voxel_to_mm(white, torch.from_numpy(np.argwhere(mask)).double())
    filled = white.with_data(np.where(deep, np.maximum(white.data, 1.0), white.data))
    field, box = cropped(filled, places), cropped(white.with_data(mask), places)
    solid = filled_cavities(box.data)
    # Among equally white voxels, depth decides. Otherwise fronts would meet inside white matter and leave wide cuts.
    depth = scipy.ndimage.distance_transform_edt(solid)
    ball = genus_zero(solid, np.minimum(field.data, 1.0) + _DEPTH_WEIGHT * depth)
    # Far from the level the values do not matter, except to the positions at the borders of the region.
    clipped = field.with_data(np.clip(field.data, level - 0.5, level + 0.5))
    return isosurface(separated_field(clipped, ball, level, _MARGIN), level)


def moved_to_edges(mesh: Mesh, white: Volume, level: float, settings: SurfaceSettings, n_offsets: int = 13) -> Mesh:
    """The surface after rounds of a move to the steepest outward decrease of intensity, each with light smoothing."""
    # Vertices that see no edge within their reach only take part in the smoothing.
    offsets = torch.linspace(-settings.reach, settings.reach, n_offsets, dtype=torch.float64)
    between = (offsets[1:] + offsets[:-1]) / 2
    for _ in range(settings.rounds):
        normals = vertex_normals(mesh)
        places = mesh.vertices[:, None] + offsets[:, None] * normals[:, None]
        profile = sample_volume(white, places.reshape(-1, 3)).reshape(-1, n_offsets)
        falls, middles = profile[:, :-1] - profile[:, 1:], (profile[:, :-1] + profile[:, 1:]) / 2
        # Of two equal edges the nearer one counts, and the one whose whiteness is nearer to the expected one.
        unlikely = (between / settings.reach) ** 2 + ((middles - level) / settings.tolerance) ** 2
        steepest = (falls * torch.exp(-unlikely / 2)).argmax(dim=1)
        seen = profile.amax(dim=1) - profile.amin(dim=1) > _INNERMOST
        move = torch.where(seen, between[steepest], 0.0) * settings.rate
        mesh = taubin_smoothing(mesh.with_vertices(mesh.vertices + move[:, None] * normals), 1)
    return mesh


_KEYS = of_both_sides(("white",))


class System(SurfaceSystem):
    """The classical way to the white surfaces of both sides. Its only trained number is a threshold."""

    name = "classical"
    groups = EdgeGroups
    surfaces = _KEYS
    networks = {"atlas": Atlas}  # noqa: RUF012 (of the class, by the protocol)

    @classmethod
    def train_parts(cls, examples: ExampleSets, settings: EdgeGroups, run: Run) -> dict[str, Part]:
        """Estimate the mean white matter and the threshold. Always on the processor."""
        surface = settings.surface
        subjects = [([item.targets[key] for key in _KEYS], item.scan.image) for item in examples.training]
        fractions = mean_fractions(subjects, surface.reduction)
        atlas = Atlas(subjects[0][1].data.shape, surface.reduction, fractions)

        def samples(item: Example) -> tuple[Tensor, Tensor]:
            """The whiteness of all voxels where white matter may lie, and the fractions that the true ones enclose."""
            image = item.scan.image
            allowed, deep = atlas.allowed(image, surface.margin).any(axis=0), atlas.deep(image).any(axis=0)
            white = whiteness(image, deep, surface.bias_width, surface.bias_rounds)
            truth = sum(enclosed_fractions(item.targets[key], image) for key in _KEYS)
            chosen = allowed & ~deep
            return tuple(torch.from_numpy(values[chosen].astype(np.float32)) for values in (white.data, truth))

        trained, kept = ([samples(item) for item in part] for part in (examples.training, examples.validation))

        def loss_of(index: int, _done: float, draws: np.random.Generator) -> Tensor:
            return misfit(*trained[index], atlas.level)

        def validate() -> dict:
            return {"validation_loss": float(np.mean([float(misfit(*each, atlas.level.detach())) for each in kept]))}

        place = run.place("atlas")
        return {"atlas": train_part(atlas, settings, examples, _KEYS, loss_of, validate, place, run.progress)}

    def find_surfaces(self, scan: Scan) -> dict[SurfaceKey, Mesh]:
        """The surfaces at the steepest decrease of intensity near the threshold."""
        atlas, settings = self.parts["atlas"].network, self.settings["atlas"].surface
        allowed, deep = atlas.allowed(scan.image, settings.margin), atlas.deep(scan.image)
        white = whiteness(scan.image, deep.any(axis=0), settings.bias_width, settings.bias_rounds)
        level, found = float(atlas.level.detach()), {}
        for number, key in enumerate(_KEYS):
            mesh = thresholded_surface(white, level, allowed[number], deep[number], " ".join(key))
            found[key] = moved_to_edges(taubin_smoothing(mesh, settings.smoothing), white, level, settings)
        return found
