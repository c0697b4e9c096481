"""A closed mesh on a voxel grid."""

import numpy as np
import scipy.ndimage

from meshot.mesh.mesh import Mesh
from meshot.types import Array, Bool, Float
from meshot.volume.volume import Volume, mm_to_voxel, voxel_sizes


def enclosed_voxels(mesh: Mesh, grid: Volume) -> Bool[Array, "X Y Z"]:
    """Which voxel centres a closed mesh encloses, by the parity of crossings along the last axis of the grid.

    Raises
    ------
    ValueError
        If a line crosses the mesh an odd number of times: then it is not closed.
    """
    corners = mm_to_voxel(grid, mesh.vertices.detach().double().cpu()).numpy()
    # A column through a vertex or an edge would be counted twice or not at all: shift by less than matters.
    corners = (corners + np.array([1.37e-7, 2.91e-7, 0.0]))[mesh.faces.cpu().numpy()]
    column, height = _crossings(corners, grid.data.shape)
    n_columns, depth = grid.data.shape[0] * grid.data.shape[1], grid.data.shape[2]
    if (np.bincount(column, minlength=n_columns) % 2).any():
        raise ValueError("a line crosses the mesh an odd number of times: it is not closed; close it first")
    above = np.clip(np.ceil(height).astype(np.int64), 0, depth)
    toggles = np.bincount(column * (depth + 1) + above, minlength=n_columns * (depth + 1)) % 2
    return (np.cumsum(toggles.reshape(*grid.data.shape[:2], depth + 1), axis=2)[:, :, :depth] % 2).astype(bool)


def _crossings(corners: Array, shape: tuple[int, ...]) -> tuple[Array, Array]:
    """For every crossing of a face with a column of voxels: the flat index of the column, the height in voxels."""
    low = np.clip(np.ceil(corners[:, :, :2].min(axis=1)).astype(np.int64), 0, None)
    high = np.minimum(np.floor(corners[:, :, :2].max(axis=1)).astype(np.int64), np.array(shape[:2]) - 1)
    extent = np.maximum(high - low + 1, 0)
    count = extent[:, 0] * extent[:, 1]
    face = np.repeat(np.arange(len(corners)), count)
    within = np.arange(len(face)) - np.repeat(np.cumsum(count) - count, count)
    x = low[face, 0] + within // extent[face, 1]
    y = low[face, 1] + within % extent[face, 1]
    a, b, c = (corners[face, i] for i in range(3))
    twice_area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (c[:, 0] - a[:, 0]) * (b[:, 1] - a[:, 1])
    safe = np.where(twice_area == 0, 1, twice_area)
    v = ((x - a[:, 0]) * (c[:, 1] - a[:, 1]) - (c[:, 0] - a[:, 0]) * (y - a[:, 1])) / safe
    w = ((b[:, 0] - a[:, 0]) * (y - a[:, 1]) - (x - a[:, 0]) * (b[:, 1] - a[:, 1])) / safe
    hit = (twice_area != 0) & (v >= 0) & (w >= 0) & (v + w <= 1)
    height = a[:, 2] + v * (b[:, 2] - a[:, 2]) + w * (c[:, 2] - a[:, 2])
    return (x * shape[1] + y)[hit], height[hit]


def voxel_distance(mesh: Mesh, grid: Volume) -> Float[Array, "X Y Z"]:
    """Signed distance of every voxel centre from a closed mesh, in mm, negative inside, to within about a voxel.

    It is measured to the nearest voxel centre on the other side, less half a voxel. Axes must be orthogonal.

    Raises
    ------
    ValueError
        As :func:`enclosed_voxels`.
    """
    inside = enclosed_voxels(mesh, grid)
    sizes = voxel_sizes(grid)
    outward = scipy.ndimage.distance_transform_edt(~inside, sampling=sizes)
    inward = scipy.ndimage.distance_transform_edt(inside, sampling=sizes)
    return np.where(inside, -(inward - sizes.mean() / 2), outward - sizes.mean() / 2)
