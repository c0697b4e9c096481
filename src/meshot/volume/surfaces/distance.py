"""Signed distance, in mm, from where a field crosses a level: finer than its voxels."""

import numpy as np

from meshot.volume.surfaces._kernel_distance import nearest_in_band, spread_nearest
from meshot.volume.surfaces.marching_cubes import isosurface
from meshot.volume.volume import Volume, mm_to_voxel, voxel_sizes

_BAND = 1.5  # of the largest voxel side
_ROUNDS = 1  # through the grid and back


def signed_distance(field: Volume, level: float = 0.5) -> Volume:
    """The distance of every voxel centre from the surface where a field crosses a level; negative where it is above.

    Parameters
    ----------
    field : Volume
        Larger inside: a probability, the enclosed part of each voxel, or a mask. Its axes must be orthogonal.
    level : float
        In the units of the field.

    Returns
    -------
    Volume
        float64, in mm; zero on :func:`meshot.volume.surfaces.isosurface`.

    Raises
    ------
    ValueError
        If the axes are not orthogonal, or no voxel, or every voxel, lies above the level.

    Notes
    -----
    Within one and a half voxels the distance to the triangles of that surface is exact. Further away every voxel takes
    the nearest point from its neighbours (Danielsson's sweeps), which is never too small and at most .3 mm too large
    on voxels of 1.5 × 1.444 × 1.5 mm, .03 mm on average. Linear time; 2 s for the standard grid.

    How far the triangles are from the truth is up to the field. For spheres of 6 to 30 mm on that grid, and over all
    voxels, enclosed parts of voxels give distances within .6 mm of the truth, on average .1 mm for the smallest sphere
    and below .06 mm from 24 mm on; a mask, which knows of no half-filled voxel, within .8 mm, on average .2 to .3 mm.
    The tests hold it to these numbers.
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
