"""The average of several scans of one person, which has less noise than one."""

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import affine_transform, gaussian_filter

from meshot.types import Array, Float
from meshot.volume.registration import register_rigid
from meshot.volume.volume import Volume

#: Inside the head. Simulated repeats with noise of 8 % of the largest value reach .99, inverted contrast reaches .1.
LOWEST_CORRELATION = 0.8


def averaged_scan(scans: Sequence[Volume], names: Sequence[str] | None = None) -> Volume:
    """The mean of several scans of one head on the grid of the first, after rigid registration to the first.

    Each scan is scaled so that it differs least from the first in the mean square, and is interpolated once with cubic
    splines. A voxel that some scans do not cover is the mean of the others.

    Parameters
    ----------
    scans : sequence of Volume
        Of one person, with the same contrast. Grids and positions may differ.
    names : sequence of str, optional
        What errors call the scans.

    Raises
    ------
    ValueError
        If there is no scan, one is constant, or one does not agree with the first after registration.
    """
    if not scans:
        raise ValueError("there is no scan; at least one is needed")
    names = [f"scan {i + 1}" for i in range(len(scans))] if names is None else names
    first = scans[0].data.astype(np.float64)
    total, covered = first.copy(), np.ones(first.shape)
    for scan, name in zip(scans[1:], names[1:], strict=True):
        moved, inside = _moved(scan, scans[0])
        agreement = _agreement(moved, first, inside)
        if not agreement >= LOWEST_CORRELATION:
            raise ValueError(
                f"{name} and {names[0]} agree poorly after registration (correlation {agreement:.2f}; "
                f"{LOWEST_CORRELATION} is needed): do both show the same head with the same contrast? Choose one"
            )
        scale = float(moved[inside] @ first[inside]) / float(moved[inside] @ moved[inside])
        total[inside] += scale * moved[inside]
        covered += inside
    return scans[0].with_data((total / covered).astype(np.float32))


def _agreement(moved: Float[Array, "x y z"], first: Float[Array, "x y z"], inside: Array) -> float:
    """The correlation of two images inside the head, after smoothing by one voxel, which removes most noise."""
    smooth = [gaussian_filter(image, 1.0) for image in (moved, first)]
    head = inside & (smooth[1] > smooth[1].mean())
    return float(np.corrcoef(smooth[0][head], smooth[1][head])[0, 1]) if head.any() else 0.0


def _moved(scan: Volume, target: Volume) -> tuple[Float[Array, "x y z"], Array]:
    """A scan at the voxels of another, and where it covers them."""
    to_voxel = np.linalg.inv(scan.affine) @ np.linalg.inv(register_rigid(scan, target)) @ target.affine
    shape = target.data.shape
    moved = affine_transform(scan.data.astype(np.float64), to_voxel[:3, :3], to_voxel[:3, 3], shape, order=3)
    ones = np.ones(scan.data.shape, dtype=np.float32)
    return moved, affine_transform(ones, to_voxel[:3, :3], to_voxel[:3, 3], shape, order=1) > 0.999
