"""Interpolation of volumes, and cropping."""

import numpy as np
import torch

from meshot.types import Float, Tensor
from meshot.volume.volume import Volume, mm_to_voxel


def sample_volume(volume: Volume, points_mm: Float[Tensor, "n 3"], outside: float = 0.0) -> Float[Tensor, " n"]:
    """Trilinear interpolation of a volume at points in scanner RAS. Differentiable with respect to the points.

    Parameters
    ----------
    volume : Volume
    points_mm : tensor
        One row per point, in mm.
    outside : float
        The value of every voxel outside the grid. Over one voxel next to the grid, the interpolation is linear.

    Returns
    -------
    tensor
        In the units of the volume and the dtype of the points.
    """
    places = mm_to_voxel(volume, points_mm) + 1
    data = torch.as_tensor(np.pad(volume.data, 1, constant_values=outside)).to(points_mm)
    last = places.new_tensor(data.shape) - 1
    # Distant points are clipped to the border, which has the outside value.
    places = torch.minimum(places.clamp(min=0), last)
    lower = torch.minimum(places.detach().floor(), last - 1).long()
    fraction = places - lower
    total = torch.zeros_like(places[:, 0])
    for corner in np.ndindex(2, 2, 2):
        step = lower.new_tensor(corner)
        weight = torch.where(step.bool(), fraction, 1 - fraction).prod(dim=1)
        total = total + weight * data[tuple((lower + step).unbind(dim=1))]
    return total


def cropped(volume: Volume, points_mm: Float[Tensor, "n 3"], margin: int = 3) -> Volume:
    """The smallest box of voxels around a set of points, plus a margin, at the same position in world space.

    Parameters
    ----------
    volume : Volume
    points_mm : tensor
        The points that the box must contain, in scanner RAS.
    margin : int
        Number of voxels added on each side, within the volume.

    Raises
    ------
    ValueError
        If the box around the points does not overlap the volume, for example because they are in different spaces.
    """
    places = mm_to_voxel(volume, points_mm.detach().double()).numpy()
    low = np.clip(np.floor(places.min(axis=0)).astype(int) - margin, 0, None)
    high = np.minimum(np.ceil(places.max(axis=0)).astype(int) + margin + 1, volume.data.shape)
    if (high <= low).any():
        raise ValueError(
            f"the points span {places.min(axis=0).round(1).tolist()} to {places.max(axis=0).round(1).tolist()} in "
            f"voxels, the volume {list(volume.data.shape)}: they do not overlap; are both in scanner RAS?"
        )
    affine = volume.affine.copy()
    affine[:3, 3] += affine[:3, :3] @ low
    return Volume(volume.data[tuple(slice(a, b) for a, b in zip(low, high, strict=True))], affine)
