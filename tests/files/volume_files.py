"""Small files of scans, made byte by byte, each with its voxels and its affine or why it is refused."""

import bz2
import dataclasses
import gzip
import struct
from collections.abc import Iterator

import mesh_files
import nibabel
import numpy as np

SHAPE = (2, 3, 4)
VALUES = np.arange(24, dtype=np.float32).reshape(SHAPE, order="F") - 5
#: Turned by 180° about the last axis: the quaternion is (0, 0, 1).
AFFINE = np.array([[-1.5, 0, 0, 90], [0, -2, 0, 126], [0, 0, 0.5, -72], [0, 0, 0, 1]])
FLIPPED = AFFINE * np.array([[-1], [1], [1], [1]])


@dataclasses.dataclass(frozen=True)
class Scan:
    """A file, and what a reader has to find in it; as :class:`mesh_files.Case`."""

    name: str
    content: bytes
    refused: str = ""
    affine: np.ndarray = dataclasses.field(default_factory=lambda: AFFINE)
    values: np.ndarray = dataclasses.field(default_factory=lambda: VALUES)
    fault: str = ""
    about: str = ""
    beside: tuple[tuple[str, bytes], ...] = ()


_TYPES = {2: "u1", 4: "i2", 8: "i4", 16: "f4", 64: "f8", 256: "i1", 512: "u2", 768: "u4", 1024: "i8", 32: "c8"}


def nifti(
    sform=AFFINE, qform=(0, 0, 1), codes=(1, 1), pixdim=(1, 1.5, 2, 0.5), offset=(90, 126, -72), unit=2, kind=16,
    order="<", vox_offset=None, slope=(1, 0), values=VALUES, dims=None, magic=b"n+1\0", extension=bytes(4), cut=None,
) -> bytes:  # fmt: skip
    """A NIfTI-1 file. ``codes``: of sform and qform; ``cut``: how many bytes of the voxels are there."""
    head = bytearray(348)
    put = lambda place, form, *given: struct.pack_into(order + form, head, place, *given)  # noqa: E731
    put(0, "i", 348)
    dims = values.shape if dims is None else dims
    put(40, "8h", len(dims), *dims, *[1] * (7 - len(dims)))
    put(70, "2h", kind, 8 * np.dtype(_TYPES.get(kind, "u1")).itemsize)
    put(76, "8f", *pixdim, *[0] * 4)
    single = magic == b"n+1\0"
    put(108, "3f", (348 + len(extension) if single else 0) if vox_offset is None else vox_offset, *slope)
    head[123] = unit
    put(252, "2h", codes[1], codes[0])
    put(256, "6f", *qform, *offset)
    put(280, "12f", *np.asarray(sform)[:3].ravel())
    head[344:348] = magic
    data = values.astype(np.dtype(_TYPES.get(kind, "u1")).newbyteorder(order)).tobytes(order="F")
    return bytes(head) + ((extension + data[:cut]) if single else b"")


def nifti2(order="<", sform=AFFINE, code=1, extension=bytes(4)) -> bytes:
    head = bytearray(540)
    put = lambda place, form, *given: struct.pack_into(order + form, head, place, *given)  # noqa: E731
    put(0, "i", 540)
    head[4:12] = b"n+2\0\r\n\x1a\n"
    put(12, "2h", 16, 32)
    put(16, "8q", 3, *SHAPE, 1, 1, 1, 1)
    put(104, "8d", 1, 1.5, 2, 0.5, 0, 0, 0, 0)
    put(168, "q", 540 + len(extension))
    put(176, "2d", 1, 0)
    put(344, "2i", 0, code)
    put(400, "12d", *sform[:3].ravel())
    put(500, "i", 2)
    return bytes(head) + extension + VALUES.astype(f"{order}f4").tobytes(order="F")


def mgh(good=1, kind=3, cut=None, shape=SHAPE) -> bytes:
    head = bytearray(284)
    struct.pack_into(">7ih", head, 0, 1, *shape, 1, kind, 0, good)
    centre = AFFINE[:3, :3] @ (np.array(SHAPE) / 2) + AFFINE[:3, 3]
    axes = AFFINE[:3, :3] / [1.5, 2, 0.5]
    struct.pack_into(">3f9f3f", head, 30, 1.5, 2, 0.5, *axes.T.ravel(), *centre)
    return bytes(head) + VALUES.astype(">f4").tobytes(order="F")[:cut]


def _affines() -> Iterator[Scan]:
    yield Scan("plain.nii", nifti(), about="its sform, code 1")
    yield Scan("big_endian.nii", nifti(order=">"), about="big endian")
    yield Scan("compressed.nii.gz", gzip.compress(nifti()), about="compressed")
    yield Scan("bzip2.nii.bz2", bz2.compress(nifti()))
    yield Scan("two_members.nii.gz", gzip.compress(nifti()[:300]) + gzip.compress(nifti()[300:]))
    yield Scan("nifti2.nii", nifti2(), about="NIfTI-2")
    yield Scan("nifti2_big_endian.nii", nifti2(">"), about="NIfTI-2, big endian")
    voxels = VALUES.astype("<f4").tobytes(order="F")
    yield Scan("pair.hdr", nifti(magic=b"ni1\0"), beside=(("pair.img", voxels),), about="header and image apart")
    yield Scan("sform_only.nii", nifti(codes=(1, 0)), about="its sform, code 1")
    yield Scan("qform_only.nii", nifti(codes=(0, 1)), about="its qform, code 1")
    yield Scan("qform_only_big_endian.nii", nifti(codes=(0, 1), order=">"), about="its qform, code 1")
    mirrored = AFFINE * np.array([1, 1, -1, 1])
    yield Scan("qfac_minus_1.nii", nifti(codes=(0, 1), pixdim=(-1, 1.5, 2, 0.5)), affine=mirrored)
    yield Scan("qfac_0.nii", nifti(codes=(0, 1), pixdim=(0, 1.5, 2, 0.5)))
    yield Scan("qfac_0_and_sform.nii", nifti(pixdim=(0, 1.5, 2, 0.5)))
    yield Scan("in_mni152.nii", nifti(codes=(4, 0)), about="MNI152, in mm")
    yield Scan("aligned.nii", nifti(codes=(2, 0)), about="aligned to another scan")
    yield Scan("unit_not_said.nii", nifti(unit=0), about="its unit is unknown, taken as mm")
    metres = AFFINE.copy()
    metres[:3] /= 1000
    small = {"pixdim": (1, 1.5e-3, 2e-3, 0.5e-3), "codes": (1, 0)}
    yield Scan("metres.nii", nifti(sform=metres, unit=1, **small), about="its unit is meter")
    large = AFFINE * [[1000], [1000], [1000], [1]]
    yield Scan("micrometres.nii", nifti(sform=large, unit=3, pixdim=(1, 1500, 2000, 500), codes=(1, 0)))
    yield Scan("metres_that_are_millimetres.nii", nifti(unit=1, codes=(1, 0)), affine=large, fault="its unit is meter")
    yield Scan("unit_with_seconds.nii", nifti(unit=2 | 8))
    yield Scan("neither.nii", nifti(codes=(0, 0)), refused="neither sform nor qform")
    yield Scan("unit_5.nii", nifti(unit=5), refused="unit of length has the code 5")
    # Contradictions.
    yield Scan("flipped_sform.nii", nifti(sform=FLIPPED), affine=FLIPPED, fault="differ in handedness")
    template = {"codes": (4, 1), "sform": FLIPPED}
    yield Scan("flipped_sform_in_mni152.nii", nifti(**template), affine=FLIPPED, fault="differ in handedness")
    unit = AFFINE @ np.diag([1 / 1.5, 0.5, 2, 1])
    yield Scan("sform_of_1_mm.nii", nifti(sform=unit), affine=unit, fault="1 × 1 × 1 by its sform and 1.5 × 2 × 0.5")
    yield Scan("sform_of_1_mm_alone.nii", nifti(sform=unit, codes=(1, 0)), affine=unit, fault="by its pixdim")
    moved = AFFINE + np.pad([[0.0], [25], [0], [0]], [(0, 0), (3, 0)])
    yield Scan("moved_sform.nii", nifti(sform=moved), affine=moved, fault="place the centre 25 mm apart")
    yield Scan("moved_sform_of_another_space.nii", nifti(sform=moved, codes=(2, 1)), affine=moved)
    swapped = AFFINE[:, [1, 0, 2, 3]] * [1, -1, 1, 1]
    swapped[:3, :2] = swapped[:3, :2] / [2, 1.5] * [1.5, 2]
    yield Scan("turned_sform.nii", nifti(sform=swapped), affine=swapped, fault="differ by 90° in the direction")
    rounded = AFFINE + np.pad([[0.0, 0, 0.001], [0, 0, 0], [-0.001, 0, 0], [0, 0, 0]], [(0, 0), (0, 1)])
    yield Scan("sform_that_differs_by_rounding.nii", nifti(sform=rounded), affine=rounded)
    zero, nan, parallel = np.zeros((4, 4)), np.full((4, 4), np.nan), AFFINE[:, [0, 0, 2, 3]]
    yield Scan("parallel_axes.nii", nifti(sform=parallel, codes=(1, 0)), refused="its sform hold NaN, zeros or no vol")
    yield Scan("sform_zero.nii", nifti(sform=zero), fault="its sform (code 1) holds NaN, zeros or no volume")
    yield Scan("sform_nan.nii", nifti(sform=nan), fault="its sform (code 1) holds NaN, zeros or no volume")
    yield Scan("sform_nan_without_code.nii", nifti(sform=nan, codes=(0, 1)), about="its qform, code 1")
    yield Scan("qform_nan.nii", nifti(qform=(np.nan, 0, 0)), about="its sform, code 1")
    yield Scan("qform_nan_without_code.nii", nifti(qform=(np.nan, 0, 0), codes=(1, 0)))
    yield Scan("sform_zero_alone.nii", nifti(sform=zero, codes=(1, 0)), refused="its sform hold NaN, zeros")
    yield Scan("qform_nan_alone.nii", nifti(qform=(np.nan, 0, 0), codes=(0, 1)), refused="its qform hold NaN, zeros")
    yield Scan("pixdim_zero_alone.nii", nifti(pixdim=(1, 0, 0, 0), codes=(0, 1)), refused="its qform hold NaN, zeros")
    yield Scan("pixdim_zero_and_sform.nii", nifti(pixdim=(1, 0, 0, 0)), about="its sform, code 1")
    long = {"qform": (0, 0, 1.0001), "codes": (0, 1)}
    yield Scan("quaternion_too_long.nii", nifti(**long), fault="its quaternion has the length 1.00010")
    yield Scan("quaternion_too_long_by_rounding.nii", nifti(qform=(0, 0, 1.0000002), codes=(0, 1)))
    yield Scan("quaternion_too_long_beside_sform.nii", nifti(qform=(0, 0, 1.0001)), fault="length 1.00010")


def _contents() -> Iterator[Scan]:
    for kind, code in (("i2", 4), ("i4", 8), ("f8", 64), ("i1", 256), ("i8", 1024)):
        yield Scan(f"type_{kind}.nii", nifti(kind=code))
    for kind, code in (("u1", 2), ("u2", 512), ("u4", 768)):
        yield Scan(f"type_{kind}.nii", nifti(kind=code, values=VALUES + 5), values=VALUES + 5)
    yield Scan("slope_2_inter_3.nii", nifti(slope=(2, 3)), values=VALUES * 2 + 3)
    yield Scan("slope_0.nii", nifti(slope=(0, 3)))
    yield Scan("slope_nan.nii", nifti(slope=(np.nan, np.nan)))
    yield Scan("vox_offset_0.nii", nifti(vox_offset=0), fault="vox_offset is 0, in the header; 352 is used")
    yield Scan("vox_offset_0.nii.gz", gzip.compress(nifti(vox_offset=0)), fault="352 is used")
    yield Scan("vox_offset_348.nii", nifti(vox_offset=348), fault="352 is used")
    note = b"\1\0\0\0" + struct.pack("<2i", 32, 6) + b"a comment".ljust(24, b"\0")
    yield Scan("extension.nii", nifti(extension=note), about="1 extensions of its header")
    yield Scan("four_axes.nii", nifti(dims=(*SHAPE, 1)))
    yield Scan("bytes_behind.nii", nifti() + b"more")
    yield Scan("series.nii", nifti(dims=(2, 3, 2, 2)), refused="three axes are needed")
    yield Scan("complex.nii", nifti(kind=32), refused="complex numbers")
    yield Scan("colours.nii", nifti(kind=128), refused="one real number each is needed")
    yield Scan("unknown_type.nii", nifti(kind=77), refused="is not a whole image that can be read")
    for value in (np.nan, np.inf):
        bad = VALUES.copy()
        bad[1, 2, 3] = value
        yield Scan(
            f"{value}.nii", nifti(values=bad), refused="1 voxels that are NaN or infinite, the first at (1, 2, 3)"
        )
    whole, packed = nifti(), gzip.compress(nifti())
    for kept in (0, 10, 200, 402):
        yield Scan(f"the_first_{kept}.nii", whole[:kept], refused="is not a whole image that can be read")
    for kept in (0, 10, len(packed) // 2, len(packed) - 20):
        yield Scan(f"the_first_{kept}.nii.gz", packed[:kept], refused="is not a whole image that can be read")
    yield Scan("wrong_checksum.nii.gz", packed[:-8] + bytes(4) + packed[-4:], refused="cut short or damaged")
    yield Scan("wrong_length.nii.gz", packed[:-4] + bytes(4), refused="cut short or damaged")
    for size in (2**31 - 16, 4000, -16, 0):
        lost = note.replace(struct.pack("<i", 32), struct.pack("<i", size))
        for version, content in ((1, nifti(extension=lost)), (2, nifti2(extension=lost))):
            said = f"an extension of its header declares {size} bytes"
            yield Scan(f"extension_of_{size}_in_{version}.nii", content, refused=said)
    for dims in ((32767,) * 3, (0, 4, 5), (-3, 4, 5)):
        yield Scan(f"dims_{dims[0]}.nii", nifti(dims=dims), refused="and at most 512³ are read")
    yield Scan("dims_19.nii", nifti(dims=(19, 8, 7)), refused="do not fit into the 448 bytes of dims_19.nii")
    yield Scan("two_axes.nii", nifti(dims=(6, 4)), refused="three axes are needed")
    yield Scan("words.nii", b"This is no image." * 40, refused="is not a whole image that can be read")
    # Other formats.
    yield Scan("plain.mgh", mgh(), about="goodRASFlag is 1")
    yield Scan("plain.mgz", gzip.compress(mgh()), about="MGH")
    yield Scan("header_cut_short.mgh", mgh()[:50], refused="is not a whole image that can be read")
    yield Scan("unknown_type.mgh", mgh(kind=2), refused="is not a whole image that can be read")
    yield Scan("more_voxels_than_bytes.mgh", mgh(shape=(400,) * 3), refused="do not fit into the")
    yield Scan("more_voxels_than_bytes.mgz", gzip.compress(mgh(shape=(400,) * 3)), refused="do not fit into the")
    yield Scan("without_orientation.mgh", mgh(good=0), refused="its goodRASFlag is 0")
    yield Scan("cut_short.mgh", mgh(cut=50), refused="is not a whole image that can be read")
    voxels = VALUES.astype("<f4").tobytes(order="F")
    analyze = bytearray(nifti(magic=bytes(4), codes=(0, 0), sform=np.zeros((4, 4)), qform=(0, 0, 0), offset=(0, 0, 0)))
    yield Scan("analyze.hdr", bytes(analyze), beside=(("analyze.img", voxels),), refused="it is an Analyze image")
    short = (("pair_of_short.img", voxels[:-40]),)
    yield Scan(
        "pair_of_short.hdr", nifti(magic=b"ni1\0"), beside=short, refused="do not fit into the 56 bytes of pair_of"
    )
    yield Scan("pair_without_image.hdr", nifti(magic=b"ni1\0"), refused="is not a whole image that can be read")
    for name, content in (("junk.par", b"junk\n"), ("junk.nii.zst", b"\x28\xb5\x2f\xfd"), ("junk.nii.bz2", b"BZh9")):
        yield Scan(name, content + bytes(99), refused="is not a whole image that can be read")
    yield Scan("junk.HEAD", b"", refused="is not a whole image that can be read")
    yield Scan("lh.surf.gii", mesh_files.gifti_of(), refused="it holds a GiftiImage")
    axes = nibabel.cifti2.ScalarAxis(["a"]), nibabel.cifti2.SeriesAxis(0, 1, 5)
    cifti = nibabel.Cifti2Image(np.zeros((1, 5), np.float32), axes)
    yield Scan("a.dscalar.nii", cifti.to_bytes(), refused="it holds a Cifti2Image")


SCANS = [*_affines(), *_contents()]
