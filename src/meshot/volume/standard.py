"""The standard grid of the paper: scans in MNI152 space, on one grid, with values in [0, 1]."""

import dataclasses

import numpy as np
from scipy.ndimage import affine_transform

from meshot.types import Array, Float, Tensor
from meshot.volume.registration import register_affine
from meshot.volume.volume import Volume, transform_points

#: The extent of the grid in mm (crop or pad to as many voxels of 1 mm), and its shape: voxels of 1.5 × 1.444 × 1.5 mm.
EXTENT_MM = (192, 208, 192)
SHAPE = (128, 144, 128)


@dataclasses.dataclass(frozen=True, eq=False)
class StandardScan:
    """A scan on the standard grid, with its transform to and from scanner space.

    Parameters
    ----------
    volume : Volume
        128 × 144 × 128 voxels, values in [0, 1]; its affine leads to MNI152 space, in mm.
    to_standard : array
        4 × 4; takes scanner RAS of the original scan to MNI152 space, in mm.
    """

    volume: Volume
    to_standard: Float[Array, "4 4"]

    def to_scanner(self, points: Float[Tensor, "n 3"]) -> Float[Tensor, "n 3"]:
        """Points of MNI152 space in scanner RAS of the original scan, in mm."""
        return transform_points(np.linalg.inv(self.to_standard), points)

    def from_scanner(self, points: Float[Tensor, "n 3"]) -> Float[Tensor, "n 3"]:
        """Points in scanner RAS of the original scan in MNI152 space, in mm."""
        return transform_points(self.to_standard, points)


def standard_scan(scan: Volume, template: Volume, seed: int = 0, quick: bool = False) -> StandardScan:
    """Prepare a scan for the networks: affine registration, cropping or padding, resampling, scaling to [0, 1].

    Parameters
    ----------
    scan : Volume
        In any orientation and voxel size.
    template : Volume
        Where to register to: the MNI152 average, see ``meshot.anatomy.templates``.
    seed : int
        Of the registration.
    quick : bool
        As in :func:`meshot.volume.register_affine`.

    Raises
    ------
    ValueError
        As :func:`meshot.volume.register_affine`.

    Notes
    -----
    The three steps use one trilinear interpolation, because each interpolation blurs. Values are scaled by the extremes
    on the grid. Outside the scan its minimum is used.

    References
    ----------
    Le et al., ICLR 2024, appendix (preprocessing).
    """
    # Rounded, because the last bits differ between CPUs. This moves no point by as much as 1e-3 mm.
    to_standard = register_affine(scan, template, seed, quick).round(6)
    return place_on_grid(scan, to_standard, centre_of_mass(template))


def place_on_grid(scan: Volume, to_standard: Float[Array, "4 4"], centre_mm: Float[Array, " 3"]) -> StandardScan:
    """A scan on the standard grid around a centre, by a known affine from scanner RAS to that space, in mm."""
    affine = _grid_affine(centre_mm)
    to_voxel = np.linalg.inv(scan.affine) @ np.linalg.inv(to_standard) @ affine
    data = scan.data.astype(np.float32)
    on_grid = affine_transform(data, to_voxel[:3, :3], to_voxel[:3, 3], SHAPE, order=1, cval=float(data.min()))
    return StandardScan(Volume(_scaled(on_grid), affine), np.asarray(to_standard, dtype=np.float64))


def _grid_affine(centre_mm: Float[Array, " 3"]) -> Float[Array, "4 4"]:
    """Voxel indices to mm for a grid whose box, from the outer sides of its voxels, lies around the centre."""
    sizes = np.divide(EXTENT_MM, SHAPE)
    affine = np.diag([*sizes, 1.0])
    affine[:3, 3] = centre_mm - sizes * (np.array(SHAPE) - 1) / 2
    return affine


def centre_of_mass(volume: Volume) -> Float[Array, " 3"]:
    """The centre of the values above the smallest, in mm; the standard grid lies around that of its template.

    Raises
    ------
    ValueError
        If the volume is constant.
    """
    weights = volume.data.astype(np.float64) - volume.data.min()
    if not weights.any():
        raise ValueError(f"the volume is {volume.data.min()} everywhere and has no centre; one with an image is needed")
    axes = [
        np.tensordot(weights.sum(axis=tuple({0, 1, 2} - {k})), np.arange(n), 1) for k, n in enumerate(weights.shape)
    ]
    return volume.affine[:3, :3] @ (np.array(axes) / weights.sum()) + volume.affine[:3, 3]


def _scaled(data: Float[Array, "x y z"]) -> Float[Array, "x y z"]:
    low, high = data.min(), data.max()
    if low == high:
        raise ValueError(f"the scan is {low} all over the standard grid: is it in the place that its affine says?")
    return (data - low) / (high - low)
