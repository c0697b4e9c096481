"""What real scans have and clean heads lack: leftovers of skull stripping, cuts that are too deep, vessels, lesions."""

import dataclasses
from collections.abc import Mapping

import numpy as np
import scipy.ndimage

from meshot.rng import Generator, numpy_generator
from meshot.synth.imaging import smooth_noise
from meshot.types import Array, Float, Int
from meshot.volume import Volume, voxel_sizes

_PATCH_MM = 25.0  # size of the patches of dura and of cuts
_LESION_MM = 6.0
_LESION_DEPTH_MM = 4.0  # lesions lie at least as deep in white matter
_STEPS, _STEP_MM = 60, 1.0  # along a vessel
_STIFFNESS = 0.9  # of a vessel: the share of its direction that a step keeps
_RADII_MM = (0.5, 1.5)  # of a vessel


@dataclasses.dataclass(frozen=True)
class Blemishes:
    """Sizes of the blemishes of one scan. With 0 there are none of that kind.

    Parameters
    ----------
    dura : float
        The share of the outer surface of the brain on which a layer of dura and marrow is left.
    dura_mm : float
        The thickness of that layer.
    cut : float
        The share of the outer surface on which skull stripping removed brain.
    cut_mm : float
        How deep it cut.
    vessels : int
        Number of bright vessels on the surface of the brain, 60 mm long and 1 to 3 mm wide.
    lesions : float
        The share of deep white matter that has the signal of grey matter.

    Raises
    ------
    ValueError
        If a share is outside [0, 1], or a size is negative.
    """

    dura: float = 0.0
    dura_mm: float = 3.0
    cut: float = 0.0
    cut_mm: float = 2.0
    vessels: int = 0
    lesions: float = 0.0

    def __post_init__(self):
        for name in ("dura", "cut", "lesions"):
            if not 0 <= getattr(self, name) <= 1:
                raise ValueError(f"{name} is {getattr(self, name)!r}; a share in [0, 1] is needed")
        if not (0 <= self.dura_mm < np.inf and 0 <= self.cut_mm < np.inf and self.vessels >= 0):
            raise ValueError(f"{self} is not possible: lengths and the number of vessels are >= 0")


Fractions = dict[str, Float[Array, "X Y Z"]]


def blemished(
    fractions: Mapping[str, Float[Array, "X Y Z"]], grid: Volume, blemishes: Blemishes, generator: Generator
) -> Fractions:
    """Tissue fractions after lesions, vessels, leftovers and cuts, in this order.

    Parameters
    ----------
    fractions : mapping
        See :func:`meshot.synth.tissue_fractions`. Dura, marrow and vessels become "scalp".
    grid : Volume
        The grid they are on.
    blemishes : Blemishes
    generator : generator or int

    Raises
    ------
    ValueError
        If there is no brain.
    """
    rng, sizes, found = numpy_generator(generator), voxel_sizes(grid), dict(fractions)
    bare = 1 - sum(found[name] for name in ("skull", "scalp")) - _air(found)
    if not (bare > 0.5).any():
        raise ValueError("the fractions contain no brain; blemishes need one")
    if blemishes.lesions > 0:
        found = _with_lesions(found, sizes, blemishes.lesions, rng)
    outside = scipy.ndimage.distance_transform_edt(bare < 0.5, sampling=sizes.tolist())
    if blemishes.vessels:
        found = _replaced(found, "scalp", _vessels(outside, sizes, blemishes.vessels, rng))
    if blemishes.dura > 0:
        layer = (outside > 0) & (outside <= blemishes.dura_mm) & _patches(bare.shape, sizes, blemishes.dura, rng)
        found = _replaced(found, "scalp", layer.astype(np.float64))
    if blemishes.cut > 0:
        inside = scipy.ndimage.distance_transform_edt(bare >= 0.5, sampling=sizes.tolist())
        gone = (inside <= blemishes.cut_mm) & _patches(bare.shape, sizes, blemishes.cut, rng)
        found = {name: np.where(gone, 0.0, part) for name, part in found.items()}
    return found


def _air(fractions: Fractions) -> Float[Array, "X Y Z"]:
    return np.clip(1 - sum(fractions.values()), 0, 1)


def _replaced(fractions: Fractions, tissue: str, share: Float[Array, "X Y Z"]) -> Fractions:
    """The fractions after ``share`` of every voxel has become one tissue."""
    return {name: part * (1 - share) + (share if name == tissue else 0) for name, part in fractions.items()}


def _patches(shape: tuple[int, ...], sizes: Float[Array, " 3"], share: float, rng: np.random.Generator) -> Array:
    """A random part of space, with a share of about ``share``."""
    field = smooth_noise(shape, _PATCH_MM / sizes, rng)
    return field > np.quantile(field, 1 - share)


def _with_lesions(fractions: Fractions, sizes: Float[Array, " 3"], share: float, rng: np.random.Generator) -> Fractions:
    depth = scipy.ndimage.distance_transform_edt(fractions["white"] > 0.5, sampling=sizes.tolist())
    deep = depth > _LESION_DEPTH_MM
    if not deep.any():
        return fractions
    field = smooth_noise(deep.shape, _LESION_MM / sizes, rng)
    found = deep & (field > np.quantile(field[deep], 1 - share))
    moved = fractions["white"] * scipy.ndimage.gaussian_filter(found.astype(np.float64), 0.5)
    return fractions | {"white": fractions["white"] - moved, "deep grey": fractions["deep grey"] + moved}


def _vessels(
    outside: Float[Array, "X Y Z"], sizes: Float[Array, " 3"], n_vessels: int, rng: np.random.Generator
) -> Float[Array, "X Y Z"]:
    """The share of vessels in every voxel: random walks along the surface of the brain."""
    starts, total = np.argwhere((outside > 0) & (outside <= 2)), np.zeros(outside.shape)
    for _ in range(n_vessels):
        path = _walk(outside, sizes, starts[rng.integers(len(starts))] * sizes, rng)
        box, share = _tube(path, outside.shape, sizes, rng.uniform(*_RADII_MM))
        total[box] = np.maximum(total[box], share)
    return total


def _walk(
    outside: Float[Array, "X Y Z"], sizes: Float[Array, " 3"], place: Float[Array, " 3"], rng: np.random.Generator
) -> Int[Array, "n 3"]:
    """The voxels of a random walk that stays near the surface of the brain."""
    heading, path, last = rng.standard_normal(3), [], np.array(outside.shape) - 1
    for _ in range(_STEPS):
        index = np.clip(np.round(place / sizes), 0, last).astype(int)
        ends = np.clip(index + np.array([-1, 1])[:, None, None] * np.eye(3, dtype=int), 0, last)
        slope = outside[tuple(ends[1].T)] - outside[tuple(ends[0].T)]
        away = slope / max(np.linalg.norm(slope), 1e-9)
        heading = _STIFFNESS * heading + (1 - _STIFFNESS) * rng.standard_normal(3)
        heading -= (heading @ away) * away + 0.2 * (outside[tuple(index)] - 1.5) * away
        heading /= max(np.linalg.norm(heading), 1e-9)
        path.append(index)
        place = place + _STEP_MM * heading
    return np.array(path)


def _tube(
    path: Int[Array, "n 3"], shape: tuple[int, ...], sizes: Float[Array, " 3"], radius: float
) -> tuple[tuple[slice, ...], Float[Array, "x y z"]]:
    """A box around a path, and the share of each of its voxels that lies within a radius of the path."""
    margin = np.ceil(radius / sizes).astype(int) + 2
    low, high = np.maximum(path.min(axis=0) - margin, 0), np.minimum(path.max(axis=0) + margin + 1, shape)
    free = np.ones(high - low, dtype=bool)
    free[tuple((path - low).T)] = False
    distance = scipy.ndimage.distance_transform_edt(free, sampling=sizes.tolist())
    box = tuple(slice(a, b) for a, b in zip(low.tolist(), high.tolist(), strict=True))
    return box, np.clip(0.5 + (radius - distance) / sizes.mean(), 0, 1)
