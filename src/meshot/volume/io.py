"""Images from files and into files, by nibabel."""

import os
import zlib
from pathlib import Path

import nibabel
import numpy as np

from meshot.files import whole_file
from meshot.volume.volume import Volume

_BROKEN = (
    nibabel.filebasedimages.ImageFileError,
    nibabel.spatialimages.HeaderDataError,
    nibabel.wrapstruct.WrapStructError,
    OSError,
    EOFError,
    ValueError,
    zlib.error,
)


def read_volume(path: str | os.PathLike) -> Volume:
    """A 3D image from NIfTI, MGH or any other format that nibabel knows, float32, with its affine to scanner RAS.

    Raises
    ------
    ValueError
        If the file is missing, truncated or no image; has more than one volume; holds NaN; or does not say where it
        lies in the scanner.
    """
    path = Path(path)
    if not path.is_file():
        raise ValueError(f"{path} does not exist or is no file")
    try:
        image = nibabel.load(path)
        data = np.asarray(image.dataobj, dtype=np.float32)
    except _BROKEN as error:
        raise ValueError(f"{path} is not a whole image that nibabel can read ({error}); get the file again") from error
    header = image.header
    if isinstance(header, nibabel.Nifti1Header) and not (header["sform_code"] > 0 or header["qform_code"] > 0):
        raise ValueError(f"{path} has neither sform nor qform: it does not say where it lies; convert the scan again")
    return Volume(data[..., 0] if data.ndim == 4 and data.shape[3] == 1 else data, image.affine)


def write_volume(path: str | os.PathLike, volume: Volume) -> None:
    """Write a NIfTI file (``.nii`` or ``.nii.gz``), in mm, with the affine as its sform; masks as 8-bit integers.

    Raises
    ------
    ValueError
        If the suffix is another.
    """
    path = Path(path)
    if not path.name.endswith((".nii", ".nii.gz")):
        raise ValueError(f"{path.name} does not end in .nii or .nii.gz; choose one of them")
    data = volume.data.astype(np.uint8) if volume.data.dtype == bool else volume.data
    narrowed = {"f": np.float32, "i": np.int32, "u": np.uint32}[data.dtype.kind] if data.itemsize > 4 else data.dtype
    image = nibabel.Nifti1Image(data.astype(narrowed), volume.affine)
    image.header.set_xyzt_units("mm")
    image.set_sform(volume.affine, code="scanner")
    image.set_qform(volume.affine, code="scanner")
    with whole_file(path) as temporary:
        nibabel.save(image, temporary)
