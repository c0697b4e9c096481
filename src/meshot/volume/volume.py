"""A scalar image with its affine, and coordinate transforms."""

import dataclasses

import numpy as np

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
        _require_image(data)
        _require_affine(affine)
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


def _require_image(data: Array) -> None:
    if data.ndim != 3:
        raise ValueError(f"data has shape {data.shape}; three axes are needed: take one image out of a series first")
    if data.size == 0:
        raise ValueError(f"data is empty (shape {data.shape}); at least one voxel along each axis is needed")
    if data.dtype.kind not in "biuf":
        raise ValueError(f"data has dtype {data.dtype}; real numbers or booleans are needed")
    bad = ~np.isfinite(data)
    if bad.any():
        first = tuple(int(i) for i in np.argwhere(bad)[0])
        raise ValueError(
            f"data has {int(bad.sum())} voxels that are NaN or infinite, the first at {first}: replace them, say, by 0"
        )


def _require_affine(affine: Array) -> None:
    if affine.shape != (4, 4) or not np.isfinite(affine).all():
        raise ValueError(f"affine has shape {affine.shape} or is not finite; a finite 4 × 4 matrix is needed")
    if not np.array_equal(affine[3], [0, 0, 0, 1]):
        raise ValueError(f"affine ends in the row {affine[3].tolist()}; [0, 0, 0, 1] is needed: is it transposed?")
    lengths = np.linalg.norm(affine[:3, :3], axis=0)
    if not lengths.min() > 0 or abs(np.linalg.det(affine[:3, :3] / np.maximum(lengths, 1e-300))) < 1e-6:
        raise ValueError(
            f"affine is singular (its columns are {lengths.tolist()} mm long): voxels have no volume; mend the header"
        )


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
