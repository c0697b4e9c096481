"""Division of a volume between markers, by a watershed."""

import numpy as np

from meshot.extras import needing
from meshot.types import Array, Bool, Float, Int

with needing("cortex"):
    import skimage.segmentation

_LEVELS = 255


def watershed_regions(
    height: Float[Array, "X Y Z"], markers: Int[Array, "X Y Z"], mask: Bool[Array, "X Y Z"]
) -> Int[Array, "X Y Z"]:
    """The marker from which each voxel is flooded first, 0 outside the mask. Regions meet where ``height`` is large.

    Parameters
    ----------
    height : array
        In [0, 1]; rounded to 255 levels, so that last bits do not change the result.
    markers : array
        Positive numbers at the voxels where the flood begins, 0 elsewhere.
    mask : array
        The voxels that are divided.

    Raises
    ------
    ValueError
        If there is no marker, or ``height`` is outside [0, 1].

    References
    ----------
    Meyer, *Un algorithme optimal pour la ligne de partage des eaux*, 1991.
    """
    if not (markers > 0).any():
        raise ValueError("markers has no positive value; mark at least one voxel")
    if not (height.min() >= 0 and height.max() <= 1):
        raise ValueError(f"height ranges from {height.min():.4g} to {height.max():.4g}; [0, 1] is needed")
    return skimage.segmentation.watershed(np.round(height * _LEVELS).astype(np.uint8), markers, mask=mask)
