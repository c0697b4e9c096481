"""Voxelisation of closed meshes."""

import numpy as np
import scipy.ndimage

from meshot.errors import require_positive_integer
from meshot.mesh import Mesh
from meshot.types import Array, Bool, Float
from meshot.volume.volume import Volume, mm_to_voxel, voxel_sizes


def enclosed_voxels(mesh: Mesh, grid: Volume) -> Bool[Array, "X Y Z"]:
    """Which voxel centres are inside a closed mesh, by the parity of intersections along the last axis of the grid.

    Raises
    ------
    ValueError
        If a line intersects the mesh an odd number of times, so that it is not closed.
    """
    column, height, _ = _crossings(_corners(mesh, grid), grid.data.shape)
    n_columns, depth = grid.data.shape[0] * grid.data.shape[1], grid.data.shape[2]
    if (np.bincount(column, minlength=n_columns) % 2).any():
        raise ValueError("a line crosses the mesh an odd number of times: it is not closed; close it first")
    above = np.clip(np.ceil(height).astype(np.int64), 0, depth)
    toggles = np.bincount(column * (depth + 1) + above, minlength=n_columns * (depth + 1)) % 2
    return (np.cumsum(toggles.reshape(*grid.data.shape[:2], depth + 1), axis=2)[:, :, :depth] % 2).astype(bool)


def enclosed_fractions(mesh: Mesh, grid: Volume, n_lines: int = 3) -> Float[Array, "X Y Z"]:
    """The fraction of every voxel that a closed mesh encloses, from 0 to 1: the partial volume.

    Lengths along the last axis are exact. Across it, ``n_lines`` × ``n_lines`` lines per voxel are averaged.

    Raises
    ------
    ValueError
        If the numbers of entries and exits of a line differ, so that the mesh is not closed; or if its normals point
        inwards.
    """
    numbers = winding_numbers(mesh, grid, n_lines)
    if numbers.min() < -1e-6:
        raise ValueError("the normals of the mesh point inwards; outward normals are needed: flip its faces")
    return np.clip(numbers, 0, 1)


def winding_numbers(mesh: Mesh, grid: Volume, n_lines: int = 3) -> Float[Array, "X Y Z"]:
    """The mean winding number of a closed mesh over every voxel: 1 inside, 0 outside.

    If the mesh intersects itself, there may be regions with -1 or 2. Lines as in
    :func:`meshot.volume.surfaces.enclosed_fractions`.

    Raises
    ------
    ValueError
        If the numbers of entries and exits of a line differ, so that the mesh is not closed.
    """
    require_positive_integer(n_lines, "n_lines")
    nx, ny, depth = grid.data.shape
    # Voxel (i, j) contains the lines n_lines·i … n_lines·i + n_lines − 1, evenly spaced.
    corners = _corners(mesh, grid)
    corners[:, :, :2] = (corners[:, :, :2] + 0.5) * n_lines - 0.5
    line, height, entering = _crossings(corners, (nx * n_lines, ny * n_lines))
    entering *= np.sign(np.linalg.det(grid.affine[:3, :3]))  # a reflected grid reverses every face
    if np.bincount(line, weights=entering).any():
        raise ValueError("a line enters the mesh more or less often than it leaves: it is not closed; close it first")
    x, y = np.divmod(line, ny * n_lines)
    # An entry adds the rest of its voxel and all voxels above; an exit subtracts the same.
    place = np.clip(height + 0.5, 0, depth)
    voxel = np.floor(place).astype(np.int64)
    column = ((x // n_lines) * ny + y // n_lines) * (depth + 2) + voxel
    filled = place - voxel
    gains = np.bincount(column, weights=entering * (1 - filled), minlength=nx * ny * (depth + 2))
    gains += np.bincount(column + 1, weights=entering * filled, minlength=nx * ny * (depth + 2))
    return np.cumsum(gains.reshape(nx, ny, depth + 2), axis=2)[:, :, :depth] / n_lines**2


def _corners(mesh: Mesh, grid: Volume) -> Float[Array, "F 3 3"]:
    """The corners of every face in voxel indices, with a negligible shift.

    Without the shift, a line through a vertex or an edge could be counted twice or not at all.
    """
    corners = mm_to_voxel(grid, mesh.vertices.detach().double().cpu()).numpy()
    return (corners + np.array([1.37e-7, 2.91e-7, 0.0]))[mesh.faces.cpu().numpy()]


def _crossings(corners: Array, shape: tuple[int, ...]) -> tuple[Array, Array, Array]:
    """The intersections of faces with lines along the last axis: the flat index of the line, the height in voxels,
    and 1 where an upward line enters the mesh, -1 where it leaves."""
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
    return (x * shape[1] + y)[hit], height[hit], -np.sign(twice_area[hit])


def voxel_distance(mesh: Mesh, grid: Volume) -> Float[Array, "X Y Z"]:
    """Signed distance of every voxel centre from a closed mesh, in mm, negative inside, accurate to about a voxel.

    It is the distance to the nearest voxel centre on the other side, minus half a voxel. Axes must be orthogonal.

    Raises
    ------
    ValueError
        If the mesh is not closed.
    """
    inside = enclosed_voxels(mesh, grid)
    sizes = voxel_sizes(grid)
    outward = scipy.ndimage.distance_transform_edt(~inside, sampling=sizes)
    inward = scipy.ndimage.distance_transform_edt(inside, sampling=sizes)
    return np.where(inside, -(inward - sizes.mean() / 2), outward - sizes.mean() / 2)
