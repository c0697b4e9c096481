"""Reading and writing of image files, with nibabel."""

import os
from pathlib import Path

import nibabel
import numpy as np

from meshot.files import whole_file
from meshot.types import Array
from meshot.volume.io_checks import UnfitImageError, affine_mm, checked_image
from meshot.volume.volume import Volume


def read_volume(path: str | os.PathLike) -> Volume:
    """Read a 3D image in NIfTI, MGH or another format of nibabel, as float32, with its affine to scanner RAS.

    Raises
    ------
    ValueError
        If the file is missing, truncated, damaged or not an image; has more than one volume or more than 512³ voxels;
        contains NaN, colours or complex numbers; or does not specify its position in the scanner.
    """
    path = Path(path)
    if not path.is_file():
        raise ValueError(f"{path} does not exist or is no file")
    try:
        image = checked_image(path)
        data, affine = np.asarray(image.dataobj, dtype=np.float32), affine_mm(image)
    except UnfitImageError as error:
        raise ValueError(f"{path} cannot be used: {error}") from error
    except Exception as error:  # the parsers raise many types
        reason = str(error).removeprefix(f"{path} is ").removesuffix("; get the file again") or type(error).__name__
        raise ValueError(f"{path} is not a whole image that can be read ({reason}); get the file again") from error
    return Volume(data.reshape(data.shape[:3]), affine)


def write_volume(path: str | os.PathLike, volume: Volume) -> None:
    """Write a file in NIfTI (``.nii``, ``.nii.gz``) or MGH (``.mgh``, ``.mgz``), in mm. Masks become 8-bit integers.

    In NIfTI, the affine is the sform, and the qform if it has no shear. MGH cannot hold shear.

    Raises
    ------
    ValueError
        If the suffix is another one, or the affine of an MGH file has shear.
    """
    path = Path(path)
    if not path.name.endswith((".nii", ".nii.gz", ".mgh", ".mgz")):
        raise ValueError(f"{path.name} does not end in .nii, .nii.gz, .mgh or .mgz; choose one of them")
    data = volume.data.astype(np.uint8) if volume.data.dtype == bool else volume.data
    narrowed = {"f": np.float32, "i": np.int32, "u": np.uint32}[data.dtype.kind] if data.itemsize > 4 else data.dtype
    image = (_mgh if path.suffix in (".mgh", ".mgz") else _nifti)(data.astype(narrowed), volume.affine)
    with whole_file(path) as temporary:
        nibabel.save(image, temporary)


def _nifti(data: Array, affine: Array) -> nibabel.Nifti1Image:
    image = nibabel.Nifti1Image(data, affine)
    image.header.set_xyzt_units("mm")
    image.set_sform(affine, code="scanner")
    image.set_qform(affine, code="scanner")
    return image


def _mgh(data: Array, affine: Array) -> nibabel.MGHImage:
    directions = affine[:3, :3] / np.linalg.norm(affine[:3, :3], axis=0)
    if np.abs(directions.T @ directions - np.eye(3)).max() > 1e-3:
        raise ValueError("the axes of the grid are not orthogonal, and MGH cannot hold that; write .nii.gz instead")
    fitting = data if data.dtype in (np.uint8, np.int16, np.int32, np.float32) else data.astype(np.float32)
    return nibabel.MGHImage(fitting, affine)
