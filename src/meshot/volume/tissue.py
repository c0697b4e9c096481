"""Tissue probabilities from intensities, and overlap of masks."""

import numpy as np

from meshot.extras import needing
from meshot.types import Array
from meshot.volume.volume import Volume

with needing("cortex"):
    import skimage.filters


def bright_volume(scan: Volume) -> float:
    """The volume of the brighter of two classes of voxels, in mm³: of a brain on a dark ground.

    The threshold is Otsu's.

    Parameters
    ----------
    scan : Volume
        Not constant.
    """
    n_bright = int((scan.data > skimage.filters.threshold_otsu(scan.data)).sum())
    return n_bright * abs(float(np.linalg.det(scan.affine[:3, :3])))


def white_matter_probability(t1: Volume, brain: Volume) -> Volume:
    """White-matter probability from T1 intensity: 0 up to the mean of grey matter, 1 from the mean of white, ½ between.

    Two thresholds divide the intensities inside the brain into three classes with minimal variance within classes
    (Otsu): fluid, grey, white. The upper threshold is mapped to ½. On both sides the map is linear up to the mean of
    the class. No atlas and no training are used.

    Parameters
    ----------
    t1 : Volume
        T1-weighted, so that white matter is brightest, without strong bias field.
    brain : Volume
        Boolean, on the same grid.

    Raises
    ------
    ValueError
        If the grids differ, the mask is empty, or fewer than three different intensities occur inside it.

    References
    ----------
    Otsu, *A threshold selection method from gray-level histograms*, 1979.
    """
    if brain.data.shape != t1.data.shape or not np.allclose(brain.affine, t1.affine):
        raise ValueError(f"t1 is {t1}, the brain mask {brain}, or their affines differ: both must share one grid")
    values = t1.data[brain.data.astype(bool)]
    if len(np.unique(values)) < 3:
        raise ValueError(
            f"the brain mask holds {len(values)} voxels of fewer than three intensities: no tissue to tell"
        )
    lower, upper = skimage.filters.threshold_multiotsu(values, classes=3, nbins=128)
    grey = values[(values > lower) & (values <= upper)].mean(dtype=np.float64)
    white = values[values > upper].mean(dtype=np.float64)
    scaled = np.interp(t1.data, [grey, upper, white], [0.0, 0.5, 1.0])
    return t1.with_data(np.where(brain.data, scaled, 0.0).astype(np.float32))


def dice(first: Array, second: Array) -> float:
    """The Dice coefficient of two masks: twice the size of the intersection over the sum of their sizes, in [0, 1].

    Raises
    ------
    ValueError
        If the shapes differ or both are empty.
    """
    total = np.count_nonzero(first) + np.count_nonzero(second)
    if np.shape(first) != np.shape(second) or total == 0:
        raise ValueError(
            f"the masks have shapes {np.shape(first)} and {np.shape(second)} and {total} voxels set in all; two of one "
            "shape, not both empty, are needed"
        )
    return 2 * np.count_nonzero(np.logical_and(first, second)) / total
