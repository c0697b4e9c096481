"""Which part of a scan is one cerebral hemisphere, by a guide surface in the same space."""

import dataclasses

import numpy as np
import scipy.ndimage
import scipy.spatial
import torch

from meshot.mesh import Mesh
from meshot.types import Array
from meshot.volume import Volume, cropped, transform_points, voxel_to_mm
from meshot.volume.surfaces import voxel_distance

CROP_VOXELS = 4
_ORIGIN = torch.zeros(1, 3, dtype=torch.float64)


@dataclasses.dataclass(frozen=True, eq=False)
class HemisphereRegion:
    """Where white matter of one hemisphere may lie, and what inside is filled whatever its tissue.

    Parameters
    ----------
    allowed : Volume
        Boolean: cerebrum of this side; neither cerebellum, nor brainstem, nor the other side.
    filled : Volume
        Boolean: ventricles, thalamus and basal ganglia, which a closed white surface encloses.
    """

    allowed: Volume
    filled: Volume


def hemisphere_region(
    grid: Volume, white: Mesh, pial: Mesh, side: str, margin: float = 1.5, depth: float = 3.0
) -> HemisphereRegion:
    """The region of one hemisphere, from a guide that need only be roughly right (a few mm).

    Allowed is what lies inside the guide's pial surface or at most ``margin`` outside, on this side of the plane
    x = 0. Along the guide's medial wall, where its white and pial surface coincide, there is no margin: that is where
    brainstem and the other hemisphere are cut off. Filled is what lies inside the guide's white surface and more than
    ``depth`` away from its cortical part.

    Parameters
    ----------
    grid : Volume
        Any volume of the scan; its values are not used. The region is cropped to the guide.
    white, pial : Mesh
        The guide, closed, in mm, with the same vertices in the same order.
    side : str
        "left" (x < 0) or "right" (x > 0).
    margin, depth : float
        In mm.

    Raises
    ------
    ValueError
        If ``side`` is another word, or the guide does not overlap the scan.
    """
    if side not in ("left", "right"):
        raise ValueError(f"side is {side!r}; 'left' or 'right' is needed")
    grid = cropped(grid, pial.vertices, CROP_VOXELS)
    wall = np.linalg.norm((pial.vertices - white.vertices).detach().double().numpy(), axis=1) < 0.05
    outside_pial = voxel_distance(pial, grid)
    places = np.argwhere(outside_pial < margin)
    points = voxel_to_mm(grid, pial.vertices.new_tensor(places)).numpy()
    on_side = points[:, 0] < 0 if side == "left" else points[:, 0] > 0
    nearest = scipy.spatial.cKDTree(pial.vertices.numpy()).query(points)[1]
    at_wall = wall[nearest] & (outside_pial[tuple(places.T)] > 0)
    from_cortex = scipy.spatial.cKDTree(white.vertices.numpy()[~wall]).query(points)[0]
    inside_white = voxel_distance(white, grid)[tuple(places.T)] < 0
    return HemisphereRegion(
        _volume_of(grid, places[on_side & ~at_wall]),
        _volume_of(grid, places[on_side & inside_white & (from_cortex > depth)]),
    )


def _volume_of(grid: Volume, places: Array) -> Volume:
    mask = np.zeros(grid.data.shape, dtype=bool)
    mask[tuple(places.T)] = True
    return grid.with_data(mask)


def restricted(probability: Volume, region: HemisphereRegion, blur: float = 0.7) -> Volume:
    """A tissue probability inside a region, 1 where the region is filled, on the region's grid.

    Parameters
    ----------
    probability : Volume
        In [0, 1]; on the grid that the region was cropped from, or on the region's own.
    region : HemisphereRegion
    blur : float
        Standard deviation, in voxels, of the Gaussian that softens the region's own borders, which are artificial and
        would otherwise leave a staircase.

    Raises
    ------
    ValueError
        If the two do not lie on one grid.
    """
    allowed, filled = (
        scipy.ndimage.gaussian_filter(part.data.astype(np.float32), blur) for part in (region.allowed, region.filled)
    )
    return region.allowed.with_data(np.maximum(_on_grid(probability, region.allowed) * allowed, filled))


def _on_grid(volume: Volume, grid: Volume) -> Array:
    offset = transform_points(np.linalg.inv(volume.affine), voxel_to_mm(grid, _ORIGIN)).numpy()[0]
    start = np.rint(offset).astype(int)
    end = start + grid.data.shape
    same_axes = np.allclose(volume.affine[:3, :3], grid.affine[:3, :3], atol=1e-6)
    if not same_axes or np.abs(offset - start).max() > 1e-3 or (start < 0).any() or (end > volume.data.shape).any():
        raise ValueError("the volume and the region do not share a grid; make the region from a volume of this scan")
    return volume.data[tuple(slice(a, b) for a, b in zip(start, end, strict=True))]
