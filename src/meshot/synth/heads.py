"""Anatomy of the head outside the cerebral cortex, taken from the MNI152 average.

:func:`template_tissue` finds ventricles, deep grey matter, cerebellum and brainstem in the average.
:class:`CarriedHead` moves them to a synthetic subject by the deformation that made its cortex, and adds the leaves of
the cerebellum, which an average does not show.
"""

import dataclasses
import functools
from collections.abc import Mapping, Sequence

import numpy as np
import scipy.ndimage
import torch

from meshot.anatomy import (
    HEMISPHERES,
    MNI305_TO_MNI152,
    fsaverage5_surface,
    mni152_brain_mask,
    mni152_grey_matter,
    mni152_t1,
    mni152_white_matter,
)
from meshot.rng import Generator, numpy_generator
from meshot.synth.imaging import DEPTH_MM, white_depth
from meshot.synth.subject import HeadWarp
from meshot.types import Array, Bool, Float, Tensor
from meshot.volume import (
    Volume,
    enclosed_fractions,
    mm_to_voxel,
    transform_points,
    voxel_sizes,
    voxel_to_mm,
    watershed_regions,
)

# Tissue of the MNI152 average outside the cerebral cortex, separated without an atlas of regions.

_CORE_MM = 7  # how far the first guess of the hindbrain is eroded, so that no cerebral cortex is left in it
_DEPTH_MM = 2.0  # structures inside the white surfaces are searched for from this depth on
#: The box of MNI152 in mm that contains ventricles and deep grey matter. Grey matter inside the white surfaces
#: elsewhere is cortex of the average, which lies in another place than that of fsaverage.
_INNER_BOX = np.array([[-46.0, -52.0, -28.0], [46.0, 32.0, 32.0]])
_SMALLEST_MM3 = 300
_SHARPNESS = 3  # exponent that makes the borders of an average as sharp as those of one head


@dataclasses.dataclass(frozen=True, eq=False)
class TemplateTissue:
    """Tissue outside the cerebral cortex on the grid of MNI152, as fractions of the voxels in [0, 1].

    Parameters
    ----------
    hindbrain : Volume
        Cerebellum and brainstem, with the fluid between them.
    hindbrain_white, hindbrain_grey : Volume
        The white and the grey matter in it. The rest is fluid.
    hindbrain_depth : Volume
        The distance to the border of the hindbrain in mm, 0 outside.
    deep_grey : Volume
        Grey matter inside the white surfaces: caudate, putamen, pallidum, thalamus.
    ventricles : Volume
        The signed distance to the border of the lateral ventricles in mm, positive inside.
    """

    hindbrain: Volume
    hindbrain_white: Volume
    hindbrain_grey: Volume
    hindbrain_depth: Volume
    deep_grey: Volume
    ventricles: Volume


@functools.cache
def template_tissue() -> TemplateTissue:
    """Separate the tissue of the MNI152 average. Takes some ten seconds, once in a process.

    The surfaces of fsaverage5 show what is cerebrum. A watershed on the maps of grey and white matter divides the rest
    of the brain between cerebrum and hindbrain: both are flooded from their interiors, and meet in the fluid below the
    tentorium.
    """
    grid = mni152_t1()
    white, pial = (
        sum(enclosed_fractions(fsaverage5_surface(kind, side, "MNI152"), grid, 1) for side in HEMISPHERES)
        for kind in ("white", "pial")
    )
    # Fractions of white matter, grey matter and fluid, with the means of many heads moved towards 0 and 1.
    both = mni152_white_matter().data, mni152_grey_matter().data
    parts = np.stack([*both, np.clip(1 - both[0] - both[1], 0, 1)]) ** _SHARPNESS
    maps = dict(zip(("white", "grey", "fluid"), parts / parts.sum(axis=0), strict=True))
    region = hindbrain_region(pial > 0.5, white > 0.5, mni152_brain_mask().data, maps["white"] + maps["grey"])
    distance = scipy.ndimage.distance_transform_edt
    soft = scipy.ndimage.gaussian_filter(region.astype(np.float32), 0.5)
    inner = distance(white > 0.5) >= _DEPTH_MM
    deep, fluid = (_large_parts(inner & (maps[tissue] > 0.5), grid) for tissue in ("grey", "fluid"))
    near_deep = scipy.ndimage.binary_dilation(deep, iterations=2) & inner
    return TemplateTissue(
        grid.with_data(soft),
        grid.with_data(soft * maps["white"]),
        grid.with_data(soft * maps["grey"]),
        grid.with_data(distance(region).astype(np.float32)),
        grid.with_data(maps["grey"] * near_deep),
        grid.with_data((distance(fluid) - distance(~fluid)).astype(np.float32)),
    )


def hindbrain_region(
    pial: Bool[Array, "X Y Z"], white: Bool[Array, "X Y Z"], brain: Bool[Array, "X Y Z"], tissue: Float[Array, "X Y Z"]
) -> Bool[Array, "X Y Z"]:
    """The voxels of cerebellum and brainstem, and of the fluid around them within the brain mask."""
    cerebrum = pial | white
    below = brain & (np.cumsum(cerebrum, axis=2) == 0) & ~scipy.ndimage.binary_dilation(cerebrum)
    core = scipy.ndimage.binary_erosion(below, iterations=_CORE_MM)
    if not core.any():
        raise ValueError(f"no voxel of the brain lies {_CORE_MM} voxels below the cerebrum; is the third axis upwards?")
    labels, _ = scipy.ndimage.label(core)
    markers = np.zeros(brain.shape, dtype=np.int32)
    markers[scipy.ndimage.binary_erosion(cerebrum) | white] = 1
    markers[labels == 1 + np.bincount(labels.ravel())[1:].argmax()] = 2
    gaps = np.clip(1 - scipy.ndimage.gaussian_filter(tissue, 0.7), 0, 1)
    return (watershed_regions(gaps, markers, brain | cerebrum) == 2) & ~cerebrum


def _large_parts(mask: Bool[Array, "X Y Z"], grid: Volume) -> Bool[Array, "X Y Z"]:
    """The connected parts of a mask, within the box of the inner structures, that are large enough."""
    low, high = (np.round(np.linalg.solve(grid.affine, [*end, 1.0])[:3]).astype(int) for end in _INNER_BOX)
    inside = np.zeros(mask.shape, dtype=bool)
    box = tuple(slice(a, b) for a, b in zip(low, high, strict=True))
    inside[box] = mask[box]
    labels, _ = scipy.ndimage.label(inside)
    large = np.bincount(labels.ravel()) >= _SMALLEST_MM3
    large[0] = False
    return large[labels]


# Leaves of the cerebellum: thin sheets of grey matter around a core of white matter, with fissures between them.

#: The leaves fan out around a line from left to right through this point of MNI152, near the roof of the fourth
#: ventricle. The brainstem lies in front of it.
FAN_MM = (0.0, -50.0, -32.0)
_OUTER_MM = 32.0  # the distance from that line at which the leaves have their stated width
_BENT = 0.2  # mm of shift per mm from the midline: leaves of the hemispheres are oblique
_WAVES_MM, _WAVE_LENGTH_MM = 2.5, 14.0


@dataclasses.dataclass(frozen=True)
class Leaves:
    """Sizes of the leaves of the cerebellum, in mm.

    Parameters
    ----------
    width : float
        The distance between neighbouring fissures at the outer surface.
    depth : float
        How deep the fissures reach.
    fissure : float
        The width of a fissure.
    cortex : float
        The thickness of the grey matter on either side of a fissure.

    Raises
    ------
    ValueError
        If a size is not positive, or a fissure and its cortex are wider than a leaf.
    """

    width: float = 4.0
    depth: float = 9.0
    fissure: float = 0.5
    cortex: float = 1.0

    def __post_init__(self):
        sizes = dataclasses.astuple(self)
        if not all(np.isfinite(size) and size > 0 for size in sizes) or self.fissure + 2 * self.cortex > self.width:
            raise ValueError(f"{self} is not possible: sizes are > 0, and fissure + 2 cortex at most the width")


def leaf_fractions(
    places: Float[Array, "n 3"], depths: Float[Array, " n"], leaves: Leaves, voxel_mm: float, generator: Generator
) -> tuple[Float[Array, " n"], Float[Array, " n"]]:
    """The shares of fluid and of white matter at positions in the cortex of the cerebellum. The rest is grey."""
    rng = numpy_generator(generator)
    x, y, z = (places - np.array(FAN_MM)).T
    radius = np.maximum(np.hypot(y, z), 1.0)
    along = _OUTER_MM * np.arctan2(z, -y) + _BENT * np.abs(x) + _waves(places, rng)
    turn = (along / leaves.width + rng.uniform()) % 1.0
    to_fissure = np.minimum(turn, 1 - turn) * leaves.width * radius / _OUTER_MM
    reached = _ramp(leaves.depth - depths, voxel_mm)
    fluid = reached * _ramp(leaves.fissure / 2 - to_fissure, voxel_mm)
    covered = np.minimum(to_fissure - leaves.fissure / 2, depths)  # the distance to the nearest fluid
    white = reached * _ramp(covered - leaves.cortex, voxel_mm)
    return fluid, white * (1 - fluid)


def _ramp(distance: Float[Array, " n"], width: float) -> Float[Array, " n"]:
    """The share of a voxel on the inner side of a border at this signed distance."""
    return np.clip(0.5 + distance / width, 0, 1)


def _waves(places: Float[Array, "n 3"], rng: np.random.Generator) -> Float[Array, " n"]:
    """Smooth random shifts in mm, from random numbers on a coarse grid."""
    if not len(places):
        return np.zeros(0)
    low = places.min(axis=0)
    shape = np.ceil((places.max(axis=0) - low) / _WAVE_LENGTH_MM).astype(int) + 4
    knots = rng.standard_normal(shape)
    return _WAVES_MM * scipy.ndimage.map_coordinates(knots, ((places - low) / _WAVE_LENGTH_MM + 1).T, order=3)


# Tissue of the average carried to a subject, by the inverse of the deformation that made its cortex.

_COARSE = 4  # the deformation is computed at every fourth voxel along each axis, and interpolated between
_GROWTH_MM = 6.0  # by which the border of the ventricles moves outwards when their size doubles
_SPARSE = 50  # every n-th voxel of the hindbrain shows where it ends, to about a voxel
_LEAST = 0.05  # fraction of grey matter from which on a voxel of the cerebellum is divided
_BRAINSTEM = (18.0, -44.0)  # mm of MNI152: within this distance of the midline and in front of it there are no leaves
Places = Float[Array, "X Y Z 3"]
Field = Float[Array, "X Y Z"]


@dataclasses.dataclass(frozen=True, eq=False)
class CarriedHead:
    """The inside of MNI152 in a subject's head, see ``meshot.synth.imaging.Interior``.

    Parameters
    ----------
    warp : HeadWarp
        The deformation that made the subject's cortex from fsaverage5.
    motion : array
        The rigid motion from head coordinates to scanner RAS.
    ventricles : float
        The size of the lateral ventricles, relative to those of the average; 0 for none.
    leaves : Leaves, optional
        Sizes of the leaves of the cerebellum. None for the smooth cerebellum of the average.
    seed : int or sequence of int
        Source of the leaves.
    """

    warp: HeadWarp
    motion: Float[Array, "4 4"]
    ventricles: float = 1.0
    leaves: Leaves | None = None
    seed: int | Sequence[int] = 0

    def ends(self) -> Float[Tensor, "n 3"]:
        """Points of the hindbrain, in scanner RAS."""
        region = template_tissue().hindbrain
        points = voxel_to_mm(region, torch.from_numpy(np.argwhere(region.data > 0.5)[::_SPARSE].astype(np.float64)))
        heads = transform_points(np.linalg.inv(MNI305_TO_MNI152), points)
        return transform_points(self.motion, self.warp.forward(heads))

    def added_to(
        self, fractions: Mapping[str, Float[Array, "X Y Z"]], inside_pial: Float[Array, "X Y Z"], grid: Volume
    ) -> dict[str, Float[Array, "X Y Z"]]:
        """Tissue fractions in which the inside of the average replaces white matter, or lies outside the pial surfaces.

        Structures inside keep a distance of ``DEPTH_MM`` to the white surfaces, which are therefore always a border
        between white matter and cortex.
        """
        tissue, places = template_tissue(), self._template_places(grid)
        deep = np.clip(_sampled(tissue.deep_grey, places), 0, 1)
        fluid = np.zeros_like(deep)
        if self.ventricles > 0:
            border = _sampled(tissue.ventricles, places, outside=-99.0) + _GROWTH_MM * (self.ventricles - 1)
            fluid = np.clip(0.5 + border, 0, 1)
            deep = deep * (1 - fluid)
        room = np.clip(0.5 + (white_depth(fractions["white"], voxel_sizes(grid)) - DEPTH_MM), 0, 1)
        inner = {"deep grey": deep * room, "fluid": fluid * room}
        # White matter, grey matter and fluid of cerebellum and brainstem.
        parts = (tissue.hindbrain, tissue.hindbrain_white, tissue.hindbrain_grey)
        inside, white, grey = (_sampled(part, places) for part in parts)
        if self.leaves is not None:
            width, front = _BRAINSTEM
            chosen = (grey > _LEAST) & ~((np.abs(places[..., 0]) < width) & (places[..., 1] > front))
            depths = _sampled(tissue.hindbrain_depth, places)[chosen]
            random = np.random.default_rng(self.seed)
            in_leaves, core_share = leaf_fractions(
                places[chosen], depths, self.leaves, float(voxel_sizes(grid).mean()), random
            )
            white[chosen] += core_share * grey[chosen]
            grey[chosen] *= 1 - core_share - in_leaves
        outer = {"hindbrain white": white, "hindbrain grey": grey, "fluid": inside - white - grey}
        outer = {name: part * (1 - inside_pial) for name, part in outer.items()}
        left = 1 - sum(inner.values())
        found = {"white": fractions["white"] * left, "grey": fractions["grey"] * left}
        found |= {"deep grey": inner["deep grey"], "hindbrain": np.zeros_like(left)}
        return found | outer | {"fluid": inner["fluid"] + outer["fluid"]}

    def _template_places(self, grid: Volume) -> Places:
        """The position in MNI152 of every voxel, in mm."""
        shape = np.array(grid.data.shape)
        coarse = -(-(shape - 1) // _COARSE) + 1
        knots = np.stack(np.meshgrid(*(np.arange(n) * _COARSE for n in coarse), indexing="ij"), axis=-1)
        scanner = voxel_to_mm(grid, torch.from_numpy(knots.reshape(-1, 3).astype(np.float64)))
        heads = self.warp.backward(transform_points(np.linalg.inv(self.motion), scanner))
        found = transform_points(MNI305_TO_MNI152, heads).numpy().reshape(*coarse, 3)
        at = np.stack(np.meshgrid(*(np.arange(n) / _COARSE for n in shape), indexing="ij"))
        return np.stack([scipy.ndimage.map_coordinates(found[..., k], at, order=1) for k in range(3)], axis=-1)


def _sampled(volume: Volume, places: Places, outside: float = 0.0) -> Field:
    at = mm_to_voxel(volume, torch.from_numpy(places.reshape(-1, 3))).numpy().T
    values = scipy.ndimage.map_coordinates(volume.data, at, order=1, cval=outside, prefilter=False)
    return values.reshape(places.shape[:-1]).astype(np.float64)
