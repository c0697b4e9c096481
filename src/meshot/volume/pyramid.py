"""A volume at several resolutions."""

import numpy as np

from meshot.errors import require_positive_integer
from meshot.volume.volume import Volume


def volume_pyramid(volume: Volume, n_scales: int = 3) -> tuple[Volume, ...]:
    """The volume, and its means over blocks of 2³, 4³, ... voxels, each with its affine.

    If the number of voxels along an axis is odd, a layer of zeros is added.

    Parameters
    ----------
    volume : Volume
    n_scales : int
        Number of volumes, including the given one.

    Raises
    ------
    ValueError
        If ``n_scales`` is not a positive integer.
    """
    require_positive_integer(n_scales, "n_scales")
    levels = [volume]
    while len(levels) < n_scales:
        levels.append(_halved(levels[-1]))
    return tuple(levels)


def _halved(volume: Volume) -> Volume:
    data = np.pad(volume.data.astype(np.result_type(volume.data, np.float32)), [(0, n % 2) for n in volume.data.shape])
    x, y, z = (n // 2 for n in data.shape)
    affine = volume.affine @ np.diag([2.0, 2.0, 2.0, 1.0])
    affine[:3, 3] += volume.affine[:3, :3] @ np.full(3, 0.5)  # the centre of the first block is between eight voxels
    return Volume(data.reshape(x, 2, y, 2, z, 2).mean(axis=(1, 3, 5)), affine)
