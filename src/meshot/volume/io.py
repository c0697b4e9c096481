"""Reading and writing of image files, with nibabel."""

import math
import os
import struct
from pathlib import Path

import nibabel
import numpy as np

from meshot.file_facts import FileFacts, heed
from meshot.files import opened, unpacked, unpacked_size, whole_file
from meshot.types import Array, Float
from meshot.volume.volume import Volume, centre_ras, voxel_sizes


def read_volume(path: str | os.PathLike, *, strict: bool = False) -> Volume:
    """Read a 3D image in NIfTI, MGH or another format of nibabel, as float32, with its affine to scanner RAS.

    In NIfTI, the sform counts if it is given, and the qform otherwise. If they contradict each other in voxel sizes,
    handedness, axes or position, there is a warning, or a refusal if ``strict``. Formats and headers that do not say
    how the head lies, such as Analyze, are refused: no orientation is assumed.
    :func:`meshot.volume.volume_facts` says which field was followed.

    Raises
    ------
    ValueError
        If the file is missing, truncated, damaged or not an image; has more than one volume or more than 512³ voxels;
        contains NaN, colours or complex numbers; or does not specify its position in the scanner.
    """
    volume, facts = read_volume_and_facts(path)
    heed(path, facts, strict)
    return volume


def volume_facts(path: str | os.PathLike) -> FileFacts:
    """What an image file says about itself: format, space and the field that states it, contradictions, and numbers.

    The facts are those that :func:`meshot.volume.read_volume` follows. Errors are the same.
    """
    return read_volume_and_facts(path)[1]


def read_volume_and_facts(path: str | os.PathLike) -> tuple[Volume, FileFacts]:
    """The image of a file, and what the file says about itself, without warnings."""
    path = Path(path)
    if not path.is_file():
        raise ValueError(f"{path} does not exist or is no file")
    try:
        image, header, faults = _checked_image(path)
        affine, space, said_by = _placed(path, image, header, faults)
        data = np.asarray(image.dataobj, dtype=np.float32)
    except UnfitImageError as error:
        raise ValueError(f"{path} cannot be used: {error}") from error
    except DamagedImageError as error:
        raise ValueError(f"{path} is not a whole image that can be read ({error}); get the file again") from error
    except Exception as error:  # the parsers raise many types, with words of their own
        raise ValueError(
            f"{path} is not a whole image that can be read: it is cut short, damaged or of another format than NIfTI, "
            "MGH and those that nibabel knows; get the file again"
        ) from error
    try:
        volume = Volume(data.reshape(data.shape[:3]), affine)
    except ValueError as error:
        raise ValueError(f"{path} cannot be used: {error}") from error
    extensions = getattr(image.header, "extensions", ())
    not_read = [f"{len(extensions)} extensions of its header"] if len(extensions) else []
    sizes = " × ".join(f"{size:.4g}" for size in voxel_sizes(volume))
    numbers = {
        "voxels": f"{' × '.join(map(str, volume.data.shape))} of {image.get_data_dtype()}",
        "voxel sizes": f"{sizes} mm",
        "axes": f"to {', '.join(_towards(column) for column in volume.affine[:3, :3].T)}",
        "centre (c_ras)": f"({', '.join(f'{value:.4g}' for value in centre_ras(volume))}) mm",
        "values": f"{volume.data.min():.4g} to {volume.data.max():.4g}",
    }
    facts = FileFacts(_format(image, path), space, said_by, tuple(faults), tuple(not_read), tuple(numbers.items()))
    return volume, facts


def _format(image: nibabel.spatialimages.SpatialImage, path: Path) -> str:
    kind = type(image)
    name = {nibabel.Nifti1Image: "NIfTI-1", nibabel.Nifti2Image: "NIfTI-2", nibabel.MGHImage: "MGH"}.get(kind)
    name = name or ("NIfTI, header and image apart" if kind.__name__.startswith("Nifti") else kind.__name__)
    order = {"<": ", little endian", ">": ", big endian"}.get(getattr(image.header, "endianness", ""), "")
    with path.open("rb") as file:
        packed = ", compressed" if file.read(2) in (b"\x1f\x8b", b"BZ") else ""
    return f"{name}{order}{packed}"


def _towards(direction: Float[Array, " 3"]) -> str:
    """The anatomical direction of an axis, and its angle to it if that is more than one degree."""
    axis = int(np.abs(direction).argmax())
    name = (("left", "right"), ("posterior", "anterior"), ("inferior", "superior"))[axis][int(direction[axis] > 0)]
    angle = np.degrees(np.arccos(min(1.0, abs(direction[axis]) / np.linalg.norm(direction))))
    return name if angle < 1 else f"{name} ({angle:.0f}° off)"


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
        axes = affine[:3, :3] / np.linalg.norm(affine[:3, :3], axis=0)
        sheared = np.abs(axes.T @ axes - np.eye(3)).max() > 1e-3
        image.set_qform(affine, code="unknown" if sheared else "scanner")
    with whole_file(path) as temporary:
        nibabel.save(image, temporary)


# Checks of image files before their voxels are read: complete, three axes of real numbers, size as declared.

#: Maximum number of voxels (512³), and maximum size of a compressed file after decompression, in bytes.
LARGEST_VOXELS, LARGEST_BYTES = 1 << 27, 1 << 29
#: By size of the NIfTI header: the marks of files with and without the voxels, their place, and the header's class.
_NIFTI = {
    348: (b"n+1\0", b"ni1\0", 344, nibabel.Nifti1Header, nibabel.Nifti1Image),
    540: (b"n+2\0", b"ni2\0", 4, nibabel.Nifti2Header, nibabel.Nifti2Image),
}
_MM = {"meter": 1e3, "mm": 1.0, "micron": 1e-3, "unknown": 1.0}
#: Formats that store the voxels without compression, so that the file is at least as large as they are.
_FLAT = (nibabel.AnalyzeImage, nibabel.MGHImage)


class UnfitImageError(ValueError):
    """The file is a whole image, but not one that can be used here. The message says what it holds."""


class DamagedImageError(ValueError):
    """The file is no whole image. The message says what is missing."""


def _checked_image(
    path: Path,
) -> tuple[nibabel.spatialimages.SpatialImage, nibabel.Nifti1Header | None, list[str]]:
    """Open an image, check its header, and return it with its voxels not yet read, its NIfTI header, and its faults."""
    try:
        n_bytes = unpacked_size(path, LARGEST_BYTES)
    except ValueError as error:
        said = str(error).removeprefix(f"{path} is ").removesuffix("; get the file again")
        raise DamagedImageError(said) from error
    header, faults, mended = _nifti_header(path, n_bytes)
    if mended is None:
        image = nibabel.load(path)
    else:
        content = unpacked(path, LARGEST_BYTES)
        size = len(mended.binaryblock)
        image = _NIFTI[size][4].from_bytes(mended.binaryblock + content[size:])
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
            raise DamagedImageError(
                f"{shape} voxels of {kind.itemsize} bytes do not fit into the {found} bytes of {holder.name}"
            )
    return image, header, faults


def _nifti_header(
    path: Path, n_bytes: int
) -> tuple[nibabel.Nifti1Header | None, list[str], nibabel.Nifti1Header | None]:
    """The header of a NIfTI file as it stands, what is wrong with it, and a mended one where nibabel needs it.

    Sizes of extensions, for which nibabel allocates memory before reading, must fit the file.
    """
    with opened(path) as file:
        head = file.read(544)
        order = next((mark for mark in "<>" if head[:4] in (struct.pack(f"{mark}i", n) for n in _NIFTI)), None)
        if order is None:
            return None, [], None
        (place,) = struct.unpack(f"{order}i", head[:4])
        single, apart, mark, kind, _ = _NIFTI[place]
        if head[mark : mark + 4] not in (single, apart) or len(head) < place:
            return None, [], None
        header, stop = kind(head[:place], endianness=order, check=False), n_bytes
        if head[mark : mark + 4] == single:
            stop = float(header["vox_offset"])
        at = place + 4
        while at + 8 <= min(stop, n_bytes):
            file.seek(at)
            (size,) = struct.unpack(f"{order}i", file.read(4))
            if not 8 <= size <= n_bytes - at:
                raise DamagedImageError(f"an extension of its header declares {size} bytes; {n_bytes - at} are left")
            at += size
    faults, mended = [], header.copy()
    if head[mark : mark + 4] == apart:
        return header, faults, None
    if not header["vox_offset"] >= place + 4:
        faults.append(f"vox_offset is {float(header['vox_offset']):g}, in the header; {place + 4} is used")
        mended["vox_offset"] = place + 4
    # What is not a rotation is left out of the copy that nibabel reads; the affine is made from the header as it is.
    numbers = [header[f"quatern_{axis}"] for axis in "bcd"]
    rotates = np.isfinite(numbers).all() and float(np.square(np.float64(numbers)).sum()) <= 1
    if not rotates or header["pixdim"][0] not in (-1, 1) or not np.isfinite(header.get_sform()).all():
        mended["qform_code"], mended["sform_code"], mended["pixdim"][0] = 0, 0, 1
        for axis in "bcd":
            mended[f"quatern_{axis}"] = 0
    return header, faults, mended if mended.binaryblock != header.binaryblock else None


# Where the voxels lie.

_SPACES = {1: "scanner RAS", 2: "RAS, aligned to another scan", 3: "Talairach", 4: "MNI152", 5: "a template"}
#: Sform and qform contradict each other beyond these: relative difference of voxel sizes, degrees, and mm.
_SIZE_APART, _DEGREES_APART, _MM_APART = 0.01, 2.0, 1.0
#: Voxel sizes of a head, in mm: others are a wrong unit.
_VOXEL_MM = (0.02, 20.0)


def _placed(
    path: Path, image: nibabel.spatialimages.SpatialImage, header: nibabel.Nifti1Header | None, faults: list[str]
) -> tuple[Float[Array, "4 4"], str, str]:
    """The affine from voxels to RAS in mm, the space, and the field that says so. Faults are added to the list."""
    if header is not None:
        return _placed_by_nifti(header, faults)
    if isinstance(image, nibabel.MGHImage):
        with opened(path) as file:  # nibabel's header has a 1 there, whatever the file says
            good = int.from_bytes(file.read(30)[28:], "big")
        if not good:
            raise UnfitImageError(
                "its goodRASFlag is 0: it does not say how the head lies, and FreeSurfer would assume coronal slices; "
                "convert the scan again"
            )
        return image.affine, "scanner RAS, in mm", "its Mdc, delta and Pxyz_c (goodRASFlag is 1)"
    if isinstance(image, nibabel.AnalyzeImage):
        matrix = image.file_map["mat"].filename if "mat" in image.file_map else None
        if matrix is None or not Path(matrix).is_file() or Path(matrix).stat().st_size == 0:
            raise UnfitImageError(
                "it is an Analyze image, which does not say how the head lies, not even which side is left; convert "
                "the scan to NIfTI from its source"
            )
        return image.affine, "RAS, in mm", f"the matrix of SPM in {Path(matrix).name}"
    return image.affine, "scanner RAS, in mm", f"its affine, as nibabel reads a {type(image).__name__}"


def _placed_by_nifti(header: nibabel.Nifti1Header, faults: list[str]) -> tuple[Float[Array, "4 4"], str, str]:
    codes = {"sform": int(header["sform_code"]), "qform": int(header["qform_code"])}
    try:
        unit = header.get_xyzt_units()[0]
        scale = _MM[unit]
    except KeyError as error:
        raise UnfitImageError(
            f"its unit of length has the code {int(header['xyzt_units']) % 8}; mm, m or µm is needed"
        ) from error
    sizes = np.float64(header["pixdim"][1:4])
    if not any(code > 0 for code in codes.values()):
        raise UnfitImageError("it has neither sform nor qform: it does not say where it lies; convert the scan again")
    sform = np.vstack([np.float64([header[f"srow_{axis}"] for axis in "xyz"]), [0, 0, 0, 1]])
    matrices = {"sform": sform, "qform": _qform(header, sizes, faults if codes["qform"] > 0 else [])}
    given = [name for name in ("sform", "qform") if codes[name] > 0]
    good = [name for name in given if _is_affine(matrices[name])]
    if not good:
        raise UnfitImageError(
            f"its {' and '.join(given)} hold NaN, zeros or no volume: it does not say where it lies; convert the scan "
            "again"
        )
    used = good[0]
    if used != given[0]:
        faults.append(f"its {given[0]} (code {codes[given[0]]}) holds NaN, zeros or no volume; its {used} is used")
    affine = np.diag([scale, scale, scale, 1.0]) @ matrices[used]
    lengths = np.linalg.norm(matrices[used][:3, :3], axis=0)
    said = f"its {used}, code {codes[used]}"
    if len(good) == 2:
        faults += _contradictions(matrices, codes, header.get_data_shape()[:3], scale)
    if (
        used == "sform"
        and np.isfinite(sizes).all()
        and (sizes > 0).all()
        and np.abs(lengths / sizes - 1).max() > _SIZE_APART
    ):
        faults.append(
            f"voxels have {_listed(lengths)} by its sform and {_listed(sizes)} by its pixdim; the sform is used"
        )
    if not _VOXEL_MM[0] < (lengths * scale).min() <= (lengths * scale).max() < _VOXEL_MM[1]:
        faults.append(f"its unit is {unit}, so that voxels have {_listed(lengths * scale)} mm: is it another one?")
    said += "" if unit == "mm" else f"; its unit is {unit}" + (", taken as mm" if unit == "unknown" else "")
    return affine, f"{_SPACES.get(codes[used], f'space {codes[used]}')}, in mm", said


def _qform(header: nibabel.Nifti1Header, sizes: Float[Array, " 3"], faults: list[str]) -> Float[Array, "4 4"]:
    """The matrix of the quaternion. One that is longer than 1 is shortened, as NIfTI's own library does."""
    b, c, d = (float(header[f"quatern_{axis}"]) for axis in "bcd")
    squared = b * b + c * c + d * d
    matrix = np.full((4, 4), np.nan)
    if not np.isfinite([squared, *sizes]).all():
        return matrix
    a = math.sqrt(max(1 - squared, 0.0))
    if squared > 1:
        b, c, d = (value / math.sqrt(squared) for value in (b, c, d))
        if squared > 1 + 1e-5:
            faults.append(f"its quaternion has the length {math.sqrt(squared):.5f}; it was shortened to 1")
    matrix[:3, :3] = [
        [a * a + b * b - c * c - d * d, 2 * (b * c - a * d), 2 * (b * d + a * c)],
        [2 * (b * c + a * d), a * a + c * c - b * b - d * d, 2 * (c * d - a * b)],
        [2 * (b * d - a * c), 2 * (c * d + a * b), a * a + d * d - b * b - c * c],
    ]
    matrix[:3, :3] *= np.abs(sizes) * [1, 1, -1 if header["pixdim"][0] == -1 else 1]
    matrix[:3, 3] = [float(header[f"qoffset_{axis}"]) for axis in "xyz"]
    matrix[3] = 0, 0, 0, 1
    return matrix


def _is_affine(matrix: Float[Array, "4 4"]) -> bool:
    lengths = np.linalg.norm(matrix[:3, :3], axis=0)
    finite = np.isfinite(matrix).all() and lengths.min() > 0
    return bool(finite and abs(np.linalg.det(matrix[:3, :3] / lengths)) > 1e-6)


def _contradictions(matrices: dict[str, Array], codes: dict[str, int], shape: tuple, scale: float) -> list[str]:
    """Where sform and qform differ. Axes and position may, if the two say that they lead to different spaces."""
    sform, qform = matrices["sform"], matrices["qform"]
    if np.linalg.det(sform[:3, :3]) * np.linalg.det(qform[:3, :3]) < 0:
        return ["its sform and its qform differ in handedness, so that left and right are exchanged; the sform is used"]
    if codes["sform"] != codes["qform"]:
        return []
    axes = [matrix[:3, :3] / np.linalg.norm(matrix[:3, :3], axis=0) for matrix in (sform, qform)]
    degrees = float(np.degrees(np.arccos(np.clip((axes[0] * axes[1]).sum(axis=0), -1, 1))).max())
    if degrees > _DEGREES_APART:
        return [f"its sform and its qform differ by {degrees:.3g}° in the direction of an axis; the sform is used"]
    centre = np.array([*(n / 2 for n in shape), 1.0])
    apart = scale * float(np.linalg.norm((sform - qform) @ centre))
    if apart > _MM_APART and np.allclose(
        sform[:3, :3], qform[:3, :3], rtol=0, atol=_SIZE_APART * np.abs(qform[:3, :3]).max()
    ):
        return [f"its sform and its qform place the centre {apart:.3g} mm apart; the sform is used"]
    return []


def _listed(values: Float[Array, " 3"]) -> str:
    return " × ".join(f"{value:.4g}" for value in values)
