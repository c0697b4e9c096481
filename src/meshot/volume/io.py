"""Reading and writing of image files, with nibabel."""

import math
import os
import struct
from pathlib import Path

import nibabel
import numpy as np

from meshot.files import opened, unpacked_size, whole_file
from meshot.types import Array, Float
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
    data, affine = data.astype(narrowed), volume.affine
    if path.suffix in (".mgh", ".mgz"):
        directions = affine[:3, :3] / np.linalg.norm(affine[:3, :3], axis=0)
        if np.abs(directions.T @ directions - np.eye(3)).max() > 1e-3:
            raise ValueError("the axes of the grid are not orthogonal, and MGH cannot hold that; write .nii.gz instead")
        fitting = data if data.dtype in (np.uint8, np.int16, np.int32, np.float32) else data.astype(np.float32)
        image = nibabel.MGHImage(fitting, affine)
    else:
        image = nibabel.Nifti1Image(data, affine)
        image.header.set_xyzt_units("mm")
        image.set_sform(affine, code="scanner")
        image.set_qform(affine, code="scanner")
    with whole_file(path) as temporary:
        nibabel.save(image, temporary)


# Checks of image files before their voxels are read: complete, three axes of real numbers, size as declared.

#: Maximum number of voxels (512³), and maximum size of a compressed file after decompression, in bytes.
LARGEST_VOXELS, LARGEST_BYTES = 1 << 27, 1 << 29
#: By size of the NIfTI header: the mark of a file that includes the voxels, and position and type of their offset.
_HEADERS = {348: (b"n+1\0", 108, "f"), 540: (b"n+2\0", 168, "q")}
_MM = {"meter": 1e3, "mm": 1.0, "micron": 1e-3, "unknown": 1.0}
#: Formats that store the voxels without compression, so that the file is at least as large as they are.
_FLAT = (nibabel.AnalyzeImage, nibabel.MGHImage)


class UnfitImageError(ValueError):
    """The file is a whole image, but not one that can be used here. The message says what it holds."""


def checked_image(path: Path) -> nibabel.spatialimages.SpatialImage:
    """Open an image, check its header, and return it with its voxels not yet read."""
    n_bytes = unpacked_size(path, LARGEST_BYTES)
    _require_room_for_extensions(path, n_bytes)
    image = nibabel.load(path)
    if not isinstance(image, nibabel.spatialimages.SpatialImage):
        raise UnfitImageError(f"it holds a {type(image).__name__}, no image on a grid")
    shape, kind = image.shape, image.get_data_dtype()
    if len(shape) != 3 and not (len(shape) == 4 and shape[3] == 1):
        raise UnfitImageError(f"it has shape {shape}; three axes are needed: take one image out of a series first")
    if min(shape) < 1 or math.prod(shape) > LARGEST_VOXELS:
        raise UnfitImageError(f"it has shape {shape}; at least one voxel along each axis and at most 512³ are read")
    if kind.kind not in "biuf":
        raise UnfitImageError(
            f"its voxels are {'complex numbers' if kind.kind == 'c' else kind}; one real number each is needed: take "
            "the magnitude, or one colour"
        )
    if isinstance(image, _FLAT):
        holder = Path(image.file_map["image"].filename or path)  # some formats have a separate header file
        found = n_bytes if holder == path else unpacked_size(holder, LARGEST_BYTES)
        if found < math.prod(shape) * kind.itemsize:
            raise ValueError(
                f"{shape} voxels of {kind.itemsize} bytes do not fit into the {found} bytes of {holder.name}"
            )
    return image


def _require_room_for_extensions(path: Path, n_bytes: int) -> None:
    """Check the declared sizes of NIfTI header extensions, for which nibabel allocates memory before reading."""
    with opened(path) as file:
        head = file.read(544)
        order = next((mark for mark in "<>" if head[:4] in (struct.pack(f"{mark}i", n) for n in _HEADERS)), None)
        if order is None:
            return
        (place,) = struct.unpack(f"{order}i", head[:4])
        single, offset, kind = _HEADERS[place]
        stop = n_bytes
        if single in head[:348]:
            (stop,) = struct.unpack_from(f"{order}{kind}", head, offset)
        place += 4
        while place + 8 <= min(stop, n_bytes):
            file.seek(place)
            (size,) = struct.unpack(f"{order}i", file.read(4))
            if not 8 <= size <= n_bytes - place:
                raise ValueError(f"an extension of its header declares {size} bytes; {n_bytes - place} are left")
            place += size


def affine_mm(image: nibabel.spatialimages.SpatialImage) -> Float[Array, "4 4"]:
    """The affine from voxels to scanner RAS in mm. NIfTI files may use metres or micrometres, which are converted."""
    header = image.header
    if not isinstance(header, nibabel.Nifti1Header):
        return image.affine
    if not (header["sform_code"] > 0 or header["qform_code"] > 0):
        raise UnfitImageError("it has neither sform nor qform: it does not say where it lies; convert the scan again")
    try:
        unit = _MM[header.get_xyzt_units()[0]]
    except KeyError as error:
        raise UnfitImageError(
            f"its unit of length has the code {int(header['xyzt_units']) % 8}; mm, m or µm is needed"
        ) from error
    return np.diag([unit, unit, unit, 1.0]) @ image.affine
