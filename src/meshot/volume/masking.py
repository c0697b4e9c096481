"""Removal of everything outside a given brain mask from a scan."""

import numpy as np

from meshot.volume.volume import Volume


def masked_scan(scan: Volume, mask: Volume) -> Volume:
    """The scan with its minimum value outside the mask.

    Parameters
    ----------
    scan : Volume
    mask : Volume
        On the grid of the scan: zero outside the brain, non-zero inside, as written by SynthStrip and HD-BET.

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
