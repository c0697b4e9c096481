"""A scalar image with its affine, and coordinate transforms."""

import dataclasses
from typing import Literal

import numpy as np
import scipy.ndimage
import torch

from meshot.errors import require_positive_integer
from meshot.extras import needing
from meshot.types import Array, Float, Tensor


@dataclasses.dataclass(frozen=True, eq=False)
class Volume:
    """A scalar image on a regular grid, with its affine. It is validated when it is created.

    Parameters
    ----------
    data : array
        Three axes; numbers or booleans, finite.
    affine : array
        4 × 4, from voxel indices (the centre of the first voxel is 0, 0, 0) to scanner RAS in mm.

    Raises
    ------
    ValueError
        If the data are empty, not 3D, not numbers, or not finite; if the affine is not 4 × 4, not finite, singular,
        or its last row is not 0, 0, 0, 1.
    """

    data: Array
    affine: Array

    def __post_init__(self):
        data, affine = np.asarray(self.data), np.asarray(self.affine, dtype=np.float64)
        if data.ndim != 3:
            raise ValueError(
                f"data has shape {data.shape}; three axes are needed: take one image out of a series first"
            )
        if data.size == 0:
            raise ValueError(f"data is empty (shape {data.shape}); at least one voxel along each axis is needed")
        if data.dtype.kind not in "biuf":
            raise ValueError(f"data has dtype {data.dtype}; real numbers or booleans are needed")
        bad = ~np.isfinite(data)
        if bad.any():
            first = tuple(int(i) for i in np.argwhere(bad)[0])
            raise ValueError(
                f"data has {int(bad.sum())} voxels that are NaN or infinite, the first at {first}: replace them, say, "
                "by 0"
            )
        if affine.shape != (4, 4) or not np.isfinite(affine).all():
            raise ValueError(f"affine has shape {affine.shape} or is not finite; a finite 4 × 4 matrix is needed")
        if not np.array_equal(affine[3], [0, 0, 0, 1]):
            raise ValueError(f"affine ends in the row {affine[3].tolist()}; [0, 0, 0, 1] is needed: is it transposed?")
        lengths = np.linalg.norm(affine[:3, :3], axis=0)
        if not lengths.min() > 0 or abs(np.linalg.det(affine[:3, :3] / np.maximum(lengths, 1e-300))) < 1e-6:
            raise ValueError(
                f"affine is singular (its columns are {lengths.tolist()} mm long): voxels have no volume; mend the "
                "header"
            )
        object.__setattr__(self, "data", data)
        object.__setattr__(self, "affine", affine)

    def with_data(self, data: Array) -> "Volume":
        """A volume with other values on the same grid.

        Raises
        ------
        ValueError
            If the shape differs; otherwise as :class:`Volume`.
        """
        if np.shape(data) != self.data.shape:
            raise ValueError(
                f"data has shape {np.shape(data)}; {self.data.shape} is needed, one value for each voxel of the grid"
            )
        return Volume(data, self.affine)

    def __repr__(self) -> str:
        return f"Volume({' × '.join(map(str, self.data.shape))}, {self.data.dtype})"


def transform_points(affine: Array, points: Float[Tensor, "n 3"]) -> Float[Tensor, "n 3"]:
    """Points transformed by a 4 × 4 affine, in the dtype of the points. All changes of space use this function."""
    matrix = points.new_tensor(np.asarray(affine))
    return points @ matrix[:3, :3].T + matrix[:3, 3]


def voxel_to_mm(volume: Volume, points_vox: Float[Tensor, "n 3"]) -> Float[Tensor, "n 3"]:
    """Positions in scanner RAS, in mm, of points given in voxel indices."""
    return transform_points(volume.affine, points_vox)


def mm_to_voxel(volume: Volume, points_mm: Float[Tensor, "n 3"]) -> Float[Tensor, "n 3"]:
    """Fractional voxel indices of points given in scanner RAS, in mm."""
    return transform_points(np.linalg.inv(volume.affine), points_mm)


def voxel_sizes(volume: Volume) -> Float[Array, " 3"]:
    """The spacing of the grid along its three axes, in mm."""
    return np.linalg.norm(volume.affine[:3, :3], axis=0)


def centre_ras(volume: Volume) -> tuple[float, float, float]:
    """FreeSurfer's c_ras: the centre of the volume, at half the number of voxels, in scanner RAS, in mm."""
    x, y, z = volume.affine[:3, :3] @ (np.array(volume.data.shape) / 2) + volume.affine[:3, 3]
    return float(x), float(y), float(z)


# Interpolation of volumes, and cropping.


def sample_volume(volume: Volume, points_mm: Float[Tensor, "n 3"], outside: float = 0.0) -> Float[Tensor, " n"]:
    """Trilinear interpolation of a volume at points in scanner RAS. Differentiable with respect to the points.

    Every voxel outside the grid has the value ``outside``; over one voxel next to the grid, the interpolation is
    linear. The result is in the units of the volume and the dtype of the points.
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


def resample(
    volume: Volume,
    shape: tuple[int, ...],
    affine: Float[Array, "4 4"],
    to_volume: Float[Array, "4 4"] | None = None,
    order: int = 1,
    outside: float | Literal["lowest", "nearest"] = 0.0,
) -> Volume:
    """A volume on another grid, interpolated once with splines.

    Parameters
    ----------
    volume : Volume
    shape, affine
        Of the grid: its number of voxels along each axis, and from its voxel indices to mm.
    to_volume : array, optional
        From the space of the grid to the scanner RAS of the volume, in mm. Left out if both are the same space.
    order : int
        Of the splines. 0 takes the nearest voxel and keeps the dtype. 1 interpolates linearly, in 32 bits, and any
        higher order in 64 bits.
    outside : float or str
        The value beyond the centres of the outer voxels: a number, the lowest of the volume, or that of its nearest
        voxel.

    Examples
    --------
    >>> coarse = Volume(np.arange(27.0).reshape(3, 3, 3), np.eye(4))
    >>> resample(coarse, (2, 2, 2), np.diag([0.5, 0.5, 0.5, 1])).data[0, 0].tolist()
    [0.0, 0.5]
    """
    to_voxel = np.linalg.inv(volume.affine) @ (np.eye(4) if to_volume is None else to_volume) @ affine
    data = volume.data if order == 0 else volume.data.astype(np.float32 if order == 1 else np.float64)
    mode, cval = "constant", outside
    if outside == "nearest":
        mode, cval = "nearest", 0.0
    elif outside == "lowest":
        cval = float(data.min())
    matrix, offset = to_voxel[:3, :3], to_voxel[:3, 3]
    return Volume(
        scipy.ndimage.affine_transform(data, matrix, offset, shape, order=order, mode=mode, cval=cval), affine
    )


def cropped(volume: Volume, points_mm: Float[Tensor, "n 3"], margin: int = 3) -> Volume:
    """The smallest box of voxels around a set of points, plus a margin, at the same position in world space.

    The points are in scanner RAS. The margin is added on each side, in voxels, within the volume.

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


# A volume at several resolutions.


def volume_pyramid(volume: Volume, n_scales: int = 3) -> tuple[Volume, ...]:
    """The volume, and its means over blocks of 2³, 4³, ... voxels, each with its affine.

    There are ``n_scales`` volumes, including the given one. If the number of voxels along an axis is odd, a layer of
    zeros is added.

    Raises
    ------
    ValueError
        If ``n_scales`` is not a positive integer.
    """
    require_positive_integer(n_scales, "n_scales")
    levels = [volume]
    while len(levels) < n_scales:
        fine = levels[-1]
        data = np.pad(fine.data.astype(np.result_type(fine.data, np.float32)), [(0, n % 2) for n in fine.data.shape])
        x, y, z = (n // 2 for n in data.shape)
        affine = fine.affine @ np.diag([2.0, 2.0, 2.0, 1.0])
        affine[:3, 3] += fine.affine[:3, :3] @ np.full(3, 0.5)  # the centre of the first block is between eight voxels
        levels.append(Volume(data.reshape(x, 2, y, 2, z, 2).mean(axis=(1, 3, 5)), affine))
    return tuple(levels)


# Removal of everything outside a given brain mask from a scan.


def masked_scan(scan: Volume, mask: Volume) -> Volume:
    """The scan with its minimum value outside the mask.

    The mask is on the grid of the scan: zero outside the brain, non-zero inside, as written by SynthStrip and HD-BET.

    Raises
    ------
    ValueError
        If the grids differ, or the mask is empty or contains all voxels.
    """
    if mask.data.shape != scan.data.shape:
        raise ValueError(
            f"the brain mask has {mask.data.shape} voxels and the scan {scan.data.shape}; make the mask of this scan, "
            "or resample it to its grid"
        )
    apart = float(np.abs(mask.affine - scan.affine).max())
    if apart > 1e-2 * float(np.abs(scan.affine[:3, :3]).max()):
        raise ValueError(
            f"the affines of brain mask and scan differ by up to {apart:.3g}; make the mask of this scan, or resample "
            "it to its grid"
        )
    inside = mask.data != 0
    if inside.all() or not inside.any():
        share = "every voxel" if inside.all() else "no voxel"
        raise ValueError(f"the brain mask holds {share} of the scan; zero outside the brain and one inside is needed")
    return scan.with_data(np.where(inside, scan.data, scan.data.min()))


# Tissue probabilities from intensities, and overlap of masks.


def bright_volume(scan: Volume) -> float:
    """The volume of the brighter of two classes of voxels, in mm³: that of a brain on a dark background.

    The classes are separated by Otsu's threshold. The scan must not be constant.
    """
    with needing("cortex"):
        from skimage.filters import threshold_otsu
    n_bright = int((scan.data > threshold_otsu(scan.data)).sum())
    return n_bright * abs(float(np.linalg.det(scan.affine[:3, :3])))


def white_matter_probability(t1: Volume, brain: Volume) -> Volume:
    """White-matter probability from T1 intensity: 0 up to the mean of grey matter, 1 from the mean of white, ½ between.

    Two thresholds divide the intensities inside the brain into three classes with minimal variance within classes
    (Otsu): fluid, grey, white. The upper threshold is mapped to ½. On both sides the map is linear up to the mean of
    the class. No atlas and no training are used. The scan is T1-weighted, so that white matter is brightest, without
    strong bias field; the brain mask is boolean, on the same grid.

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
            f"the brain mask holds {len(values)} voxels of fewer than three intensities; at least three are needed"
        )
    with needing("cortex"):
        from skimage.filters import threshold_multiotsu
    lower, upper = threshold_multiotsu(values, classes=3, nbins=128)
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
