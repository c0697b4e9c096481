"""One person as another scanner would show them: changed scans, each with the way back."""

import dataclasses
from collections.abc import Callable, Mapping

import numpy as np
import scipy.ndimage

from meshot.types import Array, Float
from meshot.volume import Volume, centre_of_mass, largest_component, resample, voxel_sizes

_FWHM = 2.3548  # full width at half maximum over standard deviation
_MARGIN_VOXELS = 8  # by which the grid of a turned head grows on each side
_AIR_MM, _CLOSED_VOXELS, _LAYER_BLUR_VOXELS = 4.0, 4, 0.6  # around a head with its skull
_SURE = 0.99  # part of white matter from which on a voxel shows the noise
_BELOW_GREY = 0.45  # of the median of white matter: what is darker is taken for fluid


@dataclasses.dataclass(frozen=True, eq=False)
class Changed:
    """A changed scan, and the affine from its scanner RAS to that of the original, in mm."""

    scan: Volume
    to_person: Float[Array, "4 4"]

    def mirrors(self) -> bool:
        """Whether the left of the changed scan shows the right of the person."""
        return bool(np.linalg.det(self.to_person) < 0)


def changed_scan(scan: Volume, white: Volume, how: Mapping[str, object], seed: int = 0) -> Changed:
    """The scan under a variant of ``config.yaml``: the kind and its sizes.

    The scan is a brain on a background of its lowest value. The part of white matter of every voxel shows the level of
    noise and of the intensities. The seed is that of noise and bias.
    """
    sizes = {key: value for key, value in how.items() if key != "kind"}
    if how.get("kind") not in KINDS:
        raise ValueError(f"the kind of variant is {how.get('kind')!r}; known are {', '.join(KINDS)}")
    return KINDS[how["kind"]](scan, white, np.random.default_rng(seed), **sizes)


def _stored(scan: Volume, white: Volume, rng: np.random.Generator) -> Changed:
    """The same voxels in another order, from front to back, top to bottom and right to left."""
    data = scan.data.transpose(1, 2, 0)[::-1, ::-1, ::-1]
    order = np.zeros((4, 4))
    for new, old in enumerate((1, 2, 0)):
        order[old, new] = -1
        order[old, 3] = scan.data.shape[old] - 1
    order[3, 3] = 1
    return Changed(Volume(np.ascontiguousarray(data), scan.affine @ order), np.eye(4))


def _turned(scan: Volume, white: Volume, rng: np.random.Generator, degrees: list[float]) -> Changed:
    """The head turned about its centre, on the grid of the scan with a margin."""
    x, y, z = np.deg2rad(degrees)
    turn = np.eye(4)
    for (a, b), angle in (((1, 2), x), ((2, 0), y), ((0, 1), z)):
        about = np.eye(4)
        about[a, a] = about[b, b] = np.cos(angle)
        about[b, a], about[a, b] = np.sin(angle), -np.sin(angle)
        turn = about @ turn
    centre = np.eye(4)
    centre[:3, 3] = centre_of_mass(scan)
    to_person = centre @ np.linalg.inv(turn) @ np.linalg.inv(centre)
    affine = scan.affine.copy()
    affine[:3, 3] -= affine[:3, :3] @ np.full(3, _MARGIN_VOXELS)
    shape = tuple(n + 2 * _MARGIN_VOXELS for n in scan.data.shape)
    return Changed(_on_grid(scan, affine, shape, to_person), to_person)


def _resampled(scan: Volume, white: Volume, rng: np.random.Generator, voxel_mm: list[float]) -> Changed:
    """Voxels of other sizes. Before they grow along an axis, the image is blurred along it."""
    old, new = voxel_sizes(scan), np.array(voxel_mm)
    blur = np.sqrt(np.clip(new**2 - old**2, 0, None)) / _FWHM / old
    smooth = scan.with_data(scipy.ndimage.gaussian_filter(scan.data.astype(np.float64), blur))
    to_old = np.diag([*(new / old), 1.0])
    to_old[:3, 3] = (new / old - 1) / 2  # the outer sides of both grids agree
    shape = tuple(int(n) for n in np.ceil(np.array(scan.data.shape) * old / new))
    return Changed(_on_grid(smooth, scan.affine @ to_old, shape, np.eye(4)), np.eye(4))


def _noisy(scan: Volume, white: Volume, rng: np.random.Generator, factor: float) -> Changed:
    """Noise added inside the brain, so that its standard deviation is ``factor`` times that of the scan."""
    added = noise_level(scan, white) * np.sqrt(factor**2 - 1) * rng.standard_normal(scan.data.shape)
    return _inside(scan, np.maximum(scan.data + added, scan.data.min()))


def _biased(scan: Volume, white: Volume, rng: np.random.Generator, of_logarithm: float, length_mm: float) -> Changed:
    """The brain times a smooth random field, whose logarithm has this standard deviation over the brain."""
    field = scipy.ndimage.gaussian_filter(rng.standard_normal(scan.data.shape), length_mm / voxel_sizes(scan))
    inside = field[scan.data > scan.data.min()]
    return _inside(scan, scan.data * np.exp(of_logarithm * (field - inside.mean()) / inside.std()))


def _bright_fluid(scan: Volume, white: Volume, rng: np.random.Generator) -> Changed:
    """Intensities inverted in part: what is darker than grey matter is mirrored at white matter, and so brightest."""
    level = _white_level(scan, white)
    dark = scan.data < _BELOW_GREY * level
    return _inside(scan, np.where(dark, 2 * level - scan.data, scan.data))


def _inverted(scan: Volume, white: Volume, rng: np.random.Generator) -> Changed:
    """All intensities of the brain inverted, as in a T2: fluid is brightest and white matter darkest."""
    high = float(np.percentile(scan.data[scan.data > scan.data.min()], 99.5))
    return _inside(scan, np.maximum(1.1 * high - scan.data, scan.data.min() + 0.02 * high))


def _cropped(scan: Volume, white: Volume, rng: np.random.Generator, lowest_mm: float) -> Changed:
    """The field of view ends this much above the lowest voxel of the brain."""
    places = np.argwhere(white.data > 0.5)
    heights = scan.affine[2, :3] @ np.indices(scan.data.shape).reshape(3, -1) + scan.affine[2, 3]
    limit = (places @ scan.affine[2, :3] + scan.affine[2, 3]).min() + lowest_mm
    above = (heights >= limit).reshape(scan.data.shape)
    return Changed(scan.with_data(np.where(above, scan.data, scan.data.min())), np.eye(4))


def _mirrored(scan: Volume, white: Volume, rng: np.random.Generator) -> Changed:
    """The mirror image of the person, left for right."""
    mirror = np.diag([-1.0, 1.0, 1.0, 1.0])
    return Changed(Volume(scan.data, mirror @ scan.affine), mirror)


def _with_skull(
    scan: Volume, white: Volume, rng: np.random.Generator, layers_mm: list[float], of_white: list[float]
) -> Changed:
    """The brain in layers of fluid, skull and scalp, with the noise of the scan, on a grid with room for them.

    ``of_white`` holds the signal of each layer relative to that of white matter. What was artificial outside the brain
    (small pieces) is covered.
    """
    sizes, margin = voxel_sizes(scan), int(np.ceil((sum(layers_mm) + _AIR_MM) / voxel_sizes(scan).min()))
    data = np.pad(scan.data.astype(np.float64), margin, constant_values=float(scan.data.min()))
    brain = largest_component(data > data.min())
    brain = scipy.ndimage.binary_fill_holes(scipy.ndimage.binary_closing(brain, iterations=_CLOSED_VOXELS))
    away = scipy.ndimage.distance_transform_edt(~brain, sampling=sizes)
    level = _white_level(scan, white)
    around, reached = np.zeros_like(data), 0.0
    for thickness, part in zip(layers_mm, of_white, strict=True):
        around[(away > reached) & (away <= reached + thickness)] = part * level
        reached += thickness
    around = scipy.ndimage.gaussian_filter(around, _LAYER_BLUR_VOXELS)
    around += noise_level(scan, white) * rng.standard_normal(data.shape)
    affine = scan.affine.copy()
    affine[:3, 3] -= affine[:3, :3] @ np.full(3, margin)
    whole = np.where(brain & (data > data.min()), data, np.maximum(around + data.min(), data.min()))
    return Changed(Volume(whole.astype(np.float32), affine), np.eye(4))


KINDS: dict[str, Callable[..., Changed]] = {
    "stored": _stored, "turned": _turned, "resampled": _resampled, "noisy": _noisy, "biased": _biased,
    "bright_fluid": _bright_fluid, "inverted": _inverted, "cropped": _cropped, "mirrored": _mirrored,
    "with_skull": _with_skull,
}  # fmt: skip


def noise_level(scan: Volume, white: Volume) -> float:
    """The standard deviation of the noise: of differences between neighbours deep in white matter, over √2.

    Half the distance between the quartiles is used, so that single edges do not count.
    """
    deep = scipy.ndimage.binary_erosion(white.data > _SURE)
    pairs = deep[1:] & deep[:-1]
    if not pairs.any():
        raise ValueError("no two neighbours lie deep in white matter; is this the white-matter map of the scan?")
    steps = np.diff(scan.data.astype(np.float64), axis=0)[pairs]
    low, high = np.percentile(steps, [25, 75])
    return float((high - low) / 1.349 / np.sqrt(2))


def _white_level(scan: Volume, white: Volume) -> float:
    return float(np.median(scan.data[white.data > _SURE]))


def _inside(scan: Volume, data: Array) -> Changed:
    """New values inside the brain alone."""
    brain = scan.data > scan.data.min()
    return Changed(scan.with_data(np.where(brain, data, scan.data.min()).astype(np.float32)), np.eye(4))


def _on_grid(scan: Volume, affine: Array, shape: tuple[int, ...], to_person: Array) -> Volume:
    """The scan on another grid, by cubic interpolation within the range of its values."""
    low, high = float(scan.data.min()), float(scan.data.max())
    moved = resample(scan, shape, affine, to_person, order=3, outside="lowest")
    return moved.with_data(np.clip(moved.data, low, high).astype(np.float32))
