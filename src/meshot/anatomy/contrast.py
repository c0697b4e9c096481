"""The contrast of a scan, adjusted by its white matter: no bias field, and the same levels in every scan.

FreeSurfer and other pipelines bring white matter to one value before they look for its surface. Here grey matter is
brought to one value, too.
"""

import numpy as np
import scipy.ndimage

from meshot.types import Array, Bool, Float
from meshot.volume import Volume, voxel_sizes

#: The values of white matter and of the grey matter beside it, in [0, 1].
WHITE, GREY = 0.75, 0.5
#: Standard deviation of the Gaussian that smooths the values of white matter, in mm.
BIAS_MM = 18.0
_CORE_VOXELS, _RING_VOXELS = 2, (1, 2)  # inside the border of white matter, and outside it
_OUTLIER = 0.35  # relative to the median of white matter
_REGULARISATION = 1e-3
_LEVELS, _SMOOTHING = np.linspace(0.2, 1.2, 101), 3.0  # of the histogram of grey matter, relative to white
#: The range of grey matter relative to white in which the values are moved.
PLAUSIBLE = (0.3, 0.92)


def contrast_by_white_matter(volume: Volume, white: Bool[Array, "X Y Z"]) -> Volume:
    """A scan without bias field, in which white matter has the value .75 and the cortex .5.

    The scan is divided by the smoothed values of its white matter. The level of grey matter is the commonest value in
    a shell around the white matter. A piecewise linear map then moves both levels, and keeps 0. If grey matter is not
    darker than white matter, the levels are left as they are; only the bias field is removed.

    Parameters
    ----------
    volume : Volume
        In [0, 1], for example on the standard grid.
    white : array
        A mask: the inside of the white surfaces of both sides. Small errors of it do not matter.

    Raises
    ------
    ValueError
        If the mask is so thin that no voxel lies two voxels inside it, or the scan is mostly 0 there.

    References
    ----------
    Dale, Fischl and Sereno, *Cortical surface-based analysis I*, NeuroImage 1999 (the value of white matter).
    """
    relative = volume.data / _smoothed_white(volume, white)
    grey = _level_of_grey(relative, white)
    if not PLAUSIBLE[0] <= grey <= PLAUSIBLE[1]:
        return volume.with_data((WHITE * relative).clip(0, 1).astype(volume.data.dtype))
    top = 1 + (1 - grey) * (1 - WHITE) / (WHITE - GREY)
    moved = np.interp(relative, [0, grey, 1, top], [0, GREY, WHITE, 1])
    return volume.with_data(moved.astype(volume.data.dtype))


def _smoothed_white(volume: Volume, white: Array) -> Float[Array, "X Y Z"]:
    """The bias field, in units of the scan: the values inside white matter, smoothed and continued."""
    core = scipy.ndimage.binary_erosion(white, iterations=_CORE_VOXELS)
    if not core.any():
        raise ValueError(f"no voxel of the white matter lies {_CORE_VOXELS} voxels inside it: was white matter found?")
    median = np.median(volume.data[core])
    if not median > 0:
        raise ValueError(f"the median of the white matter is {median:.3g}; a positive one is needed: is the scan a T1?")
    core &= np.abs(volume.data - median) <= _OUTLIER * median
    lengths = BIAS_MM / voxel_sizes(volume)
    weight, total = (
        scipy.ndimage.gaussian_filter(np.where(core, part, 0).astype(np.float64), lengths, truncate=3.0)
        for part in (1.0, volume.data)
    )
    mean = float(volume.data[core].mean(dtype=np.float64))
    return (total + _REGULARISATION * mean) / (weight + _REGULARISATION)


def _level_of_grey(relative: Array, white: Array) -> float:
    """The commonest value beside white matter, relative to white matter; 1 if there is none."""
    inner, outer = (scipy.ndimage.binary_dilation(white, iterations=n) for n in _RING_VOXELS)
    values = relative[outer & ~inner]
    counts, ends = np.histogram(values, _LEVELS)
    if not counts.any():
        return 1.0
    commonest = ends[scipy.ndimage.gaussian_filter1d(counts.astype(float), _SMOOTHING).argmax()] + np.diff(ends)[0] / 2
    near = values[np.abs(values - commonest) < 4 * _SMOOTHING * np.diff(ends)[0]]
    # Rounded, because the last bits differ between processors.
    return round(float(np.median(near)), 3)
