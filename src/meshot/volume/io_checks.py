"""What an image file must be before its voxels are read: whole, real numbers, in three axes, no larger than it says."""

import math
import struct
from pathlib import Path

import nibabel
import numpy as np

from meshot.compressed import opened, unpacked_size
from meshot.types import Array, Float

#: The most voxels that are read: a cube of 512. And the most bytes that a compressed file may hold.
LARGEST_VOXELS, LARGEST_BYTES = 1 << 27, 1 << 29
#: By the size of a NIfTI header: the mark of a file that holds its voxels too; where and as what their place stands.
_HEADERS = {348: (b"n+1\0", 108, "f"), 540: (b"n+2\0", 168, "q")}
_MM = {"meter": 1e3, "mm": 1.0, "micron": 1e-3, "unknown": 1.0}
#: Formats whose voxels lie in the file one after another, so that the file cannot be smaller than they are.
_FLAT = (nibabel.AnalyzeImage, nibabel.MGHImage)


def checked_image(path: Path) -> nibabel.spatialimages.SpatialImage:
    """An image whose header nibabel has read, and whose voxels may be read next.

    Raises
    ------
    ValueError
        If a compressed stream is damaged or unpacks to more than 512 MiB; if there are more than 512³ voxels, or more
        than the file holds; if it is a surface, a series, or holds colours or complex numbers.
    """
    n_bytes = unpacked_size(path, LARGEST_BYTES)
    _require_room_for_extensions(path, n_bytes)
    image = nibabel.load(path)
    if not isinstance(image, nibabel.spatialimages.SpatialImage):
        raise ValueError(f"it holds a {type(image).__name__}, no image on a grid")
    shape, kind = image.shape, image.get_data_dtype()
    if len(shape) != 3 and not (len(shape) == 4 and shape[3] == 1):
        raise ValueError(f"it has shape {shape}; three axes are needed: take one image out of a series first")
    if min(shape) < 1 or math.prod(shape) > LARGEST_VOXELS:
        raise ValueError(f"it has shape {shape}; at least one voxel along each axis and at most 512³ in all are read")
    if kind.kind not in "biuf":
        raise ValueError(
            f"its voxels are {'complex numbers' if kind.kind == 'c' else kind}; one real number each is needed: take "
            "the magnitude, or one colour"
        )
    if isinstance(image, _FLAT):
        holder = Path(image.file_map["image"].filename or path)  # some formats keep the header in a file of its own
        found = n_bytes if holder == path else unpacked_size(holder, LARGEST_BYTES)
        if found < math.prod(shape) * kind.itemsize:
            raise ValueError(
                f"{shape} voxels of {kind.itemsize} bytes do not fit into the {found} bytes of {holder.name}"
            )
    return image


def _require_room_for_extensions(path: Path, n_bytes: int) -> None:
    """NIfTI may put blocks between header and voxels; nibabel makes room for what they declare before it reads."""
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
    """From voxels to scanner RAS in mm; NIfTI may state metres or micrometres.

    Raises
    ------
    ValueError
        If NIfTI does not say where it lies, or in which unit.
    """
    header = image.header
    if not isinstance(header, nibabel.Nifti1Header):
        return image.affine
    if not (header["sform_code"] > 0 or header["qform_code"] > 0):
        raise ValueError("it has neither sform nor qform: it does not say where it lies; convert the scan again")
    try:
        unit = _MM[header.get_xyzt_units()[0]]
    except KeyError as error:
        raise ValueError(
            f"its unit of length has the code {int(header['xyzt_units']) % 8}; mm, m or µm is needed"
        ) from error
    return np.diag([unit, unit, unit, 1.0]) @ image.affine
