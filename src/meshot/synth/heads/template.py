"""Tissue of the MNI152 average outside the cerebral cortex, separated without an atlas of regions."""

import dataclasses
import functools

import numpy as np
import scipy.ndimage

from meshot.anatomy import (
    HEMISPHERES,
    fsaverage5_surface,
    mni152_brain_mask,
    mni152_grey_matter,
    mni152_t1,
    mni152_white_matter,
)
from meshot.types import Array, Bool, Float
from meshot.volume import Volume
from meshot.volume.surfaces import enclosed_fractions, watershed_regions

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
    white, pial = (_enclosed(kind, grid) for kind in ("white", "pial"))
    maps = _sharpened(mni152_white_matter().data, mni152_grey_matter().data)
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
    """The voxels of cerebellum and brainstem, and of the fluid around them within the brain mask.

    Parameters
    ----------
    pial, white : array
        The voxels inside the surfaces of the cerebrum. The third axis points upwards.
    brain : array
        The brain mask.
    tissue : array
        The fraction of grey and white matter.

    Raises
    ------
    ValueError
        If no part of the brain lies deep enough below the cerebrum.
    """
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


def _enclosed(kind: str, grid: Volume) -> Float[Array, "X Y Z"]:
    meshes = [fsaverage5_surface(kind, side, "MNI152") for side in HEMISPHERES]
    return sum(enclosed_fractions(mesh, grid, 1) for mesh in meshes)


def _sharpened(white: Float[Array, "X Y Z"], grey: Float[Array, "X Y Z"]) -> dict[str, Float[Array, "X Y Z"]]:
    """Fractions of white matter, grey matter and fluid, with the means of many heads moved towards 0 and 1."""
    parts = np.stack([white, grey, np.clip(1 - white - grey, 0, 1)]) ** _SHARPNESS
    parts /= parts.sum(axis=0)
    return dict(zip(("white", "grey", "fluid"), parts, strict=True))


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
