"""Signed distance, in mm, from a level set of a field, with subvoxel accuracy."""

import numpy as np

from meshot.volume.surfaces._kernel_distance import nearest_in_band, spread_nearest
from meshot.volume.surfaces.marching_cubes import isosurface
from meshot.volume.volume import Volume, mm_to_voxel, voxel_sizes

_BAND = 1.5  # in units of the largest voxel side
_ROUNDS = 1  # forward and backward sweep through the grid


def signed_distance(field: Volume, level: float = 0.5) -> Volume:
    """The distance of every voxel centre from the level set of a field, negative where the field is above the level.

    Parameters
    ----------
    field : Volume
        Larger inside: a probability, the enclosed fraction of each voxel, or a mask. Its axes must be orthogonal.
    level : float
        In the units of the field.

    Returns
    -------
    Volume
        float64, in mm; zero on :func:`meshot.volume.surfaces.isosurface`.

    Raises
    ------
    ValueError
        If the axes are not orthogonal, or no voxel, or every voxel, is above the level.

    Notes
    -----
    Up to one and a half voxels, the distance to the triangles of that surface is exact. Further away, every voxel uses
    the nearest points of its neighbours (Danielsson's sweeps). The result is never too small, and at most .3 mm too
    large for voxels of 1.5 × 1.444 × 1.5 mm, .03 mm on average. Linear time; 2 s for the standard grid.

    The distance of the triangles from the true surface depends on the field. For spheres of 6 to 30 mm on that grid,
    over all voxels, enclosed fractions give errors below .6 mm, on average .1 mm for the smallest sphere and below
    .06 mm from 24 mm on. Masks, which contain no partial volumes, give errors below .8 mm, on average .2 to .3 mm. The
    tests check these numbers.
    """
    axes = field.affine[:3, :3] / voxel_sizes(field)
    if np.abs(axes.T @ axes - np.eye(3)).max() > 1e-4:
        raise ValueError("the axes of the volume are not orthogonal, so that voxels are not boxes; resample it first")
    mesh, sizes = isosurface(field, level), voxel_sizes(field)
    corners = (mm_to_voxel(field, mesh.vertices).numpy() * sizes)[mesh.faces.numpy()]
    squared, foot = nearest_in_band(corners, sizes, field.data.shape, _BAND * sizes.max())
    spread_nearest(squared, foot, sizes, _ROUNDS)
    distance = np.sqrt(squared)
    return field.with_data(np.where(field.data > level, -distance, distance))
