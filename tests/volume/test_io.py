"""Images through files; bad, damaged and too large ones are refused with one clear error, and soon."""

import gzip
import warnings
import zlib

import nibabel
import numpy as np
import pytest

from affines import FLIPPED, OBLIQUE
from meshot.anatomy.templates import mni152_t1
from meshot.volume import io as io_checks
from meshot.volume.io import read_volume, write_volume
from meshot.volume.registration import place_on_grid, standard_scan
from meshot.volume.volume import Volume, volume_pyramid
from refusals import refuses


@pytest.mark.parametrize("affine", [FLIPPED, OBLIQUE], ids=["flipped", "oblique"])
@pytest.mark.parametrize("name", ["a.nii", "a.nii.gz"])
def test_there_and_back(tmp_path, affine, name):
    volume = Volume(np.random.default_rng(0).normal(size=(4, 5, 6)), affine)
    write_volume(tmp_path / name, volume)
    again = read_volume(tmp_path / name)
    np.testing.assert_allclose(again.data, volume.data, rtol=1e-6)
    np.testing.assert_allclose(again.affine, affine, atol=1e-5)
    assert nibabel.load(tmp_path / name).header["sform_code"] == 1


def test_masks_become_bytes(tmp_path):
    mask = np.random.default_rng(0).random((4, 5, 6)) < 0.5
    write_volume(tmp_path / "m.nii.gz", Volume(mask, np.eye(4)))
    assert nibabel.load(tmp_path / "m.nii.gz").get_data_dtype() == np.uint8
    assert (read_volume(tmp_path / "m.nii.gz").data == mask).all()


def test_a_single_volume_with_four_axes_is_taken_and_a_series_is_not(tmp_path):
    for n in (1, 2):
        nibabel.save(nibabel.Nifti1Image(np.zeros((3, 4, 5, n), np.float32), np.eye(4)), tmp_path / f"{n}.nii")
    assert read_volume(tmp_path / "1.nii").data.shape == (3, 4, 5)
    refuses(r"2\.nii cannot be used: it has shape .*three axes", read_volume, tmp_path / "2.nii")


def test_broken_files_are_refused(tmp_path):
    write_volume(tmp_path / "a.nii.gz", Volume(np.random.default_rng(0).normal(size=(20, 20, 20)), np.eye(4)))
    whole = (tmp_path / "a.nii.gz").read_bytes()
    (tmp_path / "half.nii.gz").write_bytes(whole[: len(whole) // 2])
    write_volume(tmp_path / "a.nii", Volume(np.ones((20, 20, 20)), np.eye(4)))
    (tmp_path / "half.nii").write_bytes((tmp_path / "a.nii").read_bytes()[:9000])
    (tmp_path / "garbage.nii").write_bytes(b"no image" * 100)
    (tmp_path / "empty.nii.gz").write_bytes(b"")
    for name in ("half.nii.gz", "half.nii", "garbage.nii", "empty.nii.gz"):
        refuses("not a whole image", read_volume, tmp_path / name)
    refuses("does not exist", read_volume, tmp_path / "missing.nii")


def test_an_image_without_a_place_is_refused(tmp_path):
    nibabel.save(nibabel.Nifti1Image(np.zeros((3, 4, 5), np.float32), None), tmp_path / "a.nii")
    refuses("neither sform nor qform", read_volume, tmp_path / "a.nii")


def test_other_suffixes_are_refused(tmp_path):
    with pytest.raises(ValueError, match=r"\.nii, \.nii\.gz, \.mgh or \.mgz"):
        write_volume(tmp_path / "a.png", Volume(np.zeros((2, 2, 2)), np.eye(4)))


SQUARE = np.diag([-1.2, 1.0, 0.9, 1.0])[[0, 2, 1, 3]] + np.pad([[30.0], [-4], [2], [0]], [(0, 0), (3, 0)])


# nibabel leaves an uncompressed MGH file open after it has read it.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("name", ["a.mgh", "a.mgz"])
@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.uint8, np.int16, bool])
def test_mgh_there_and_back(tmp_path, name, dtype):
    volume = Volume((np.random.default_rng(0).random((4, 5, 6)) * 2).astype(dtype), SQUARE)
    write_volume(tmp_path / name, volume)
    again = read_volume(tmp_path / name)
    np.testing.assert_allclose(again.data, volume.data, rtol=1e-6)
    np.testing.assert_allclose(again.affine, SQUARE, atol=1e-5)


def test_mgh_refuses_shear(tmp_path):
    refuses("not orthogonal", write_volume, tmp_path / "a.mgz", Volume(np.zeros((4, 5, 6)), OBLIQUE))


def values(*shape: int) -> np.ndarray:
    return np.random.default_rng(0).normal(size=shape or (9, 8, 7)).astype(np.float32)


@pytest.mark.parametrize("name", ["a.nii.gz", "a.mgz"])
def test_every_flipped_bit_of_a_compressed_scan_is_seen(tmp_path, name):
    nibabel.save((nibabel.MGHImage if name == "a.mgz" else nibabel.Nifti1Image)(values(), OBLIQUE), tmp_path / name)
    whole = (tmp_path / name).read_bytes()
    expected = read_volume(tmp_path / name).data
    random = np.random.default_rng(1)
    for place in random.integers(10, len(whole), 60):  # before lie the time and flags that decide nothing
        flipped = bytearray(whole)
        flipped[place] ^= 1 << random.integers(8)
        (tmp_path / name).write_bytes(flipped)
        try:
            found = read_volume(tmp_path / name).data
        except ValueError:
            continue
        assert np.array_equal(found, expected)  # the name in the header of the stream is not part of the data


@pytest.mark.parametrize("part", [slice(-8, -4), slice(-4, None)], ids=["checksum", "length"])
def test_a_wrong_trailer_is_refused(tmp_path, part):
    write_volume(tmp_path / "a.nii.gz", Volume(values(), np.eye(4)))
    content = bytearray((tmp_path / "a.nii.gz").read_bytes())
    content[part] = bytes(4)
    (tmp_path / "a.nii.gz").write_bytes(content)
    refuses("cut short or damaged", read_volume, tmp_path / "a.nii.gz")


def nifti(path, data, affine=OBLIQUE, unit=None):
    image = nibabel.Nifti1Image(data, affine)
    if unit is not None:
        image.header.set_xyzt_units(unit)
    nibabel.save(image, path)


@pytest.mark.parametrize(("unit", "millimetres"), [("meter", 1e3), ("mm", 1.0), ("micron", 1e-3), ("unknown", 1.0)])
def test_units_of_nifti_become_millimetres(tmp_path, unit, millimetres):
    nifti(tmp_path / "a.nii", values(), unit=unit)
    # sform and pixdim are 32-bit numbers
    expected = np.diag([millimetres] * 3 + [1]) @ OBLIQUE
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        found = read_volume(tmp_path / "a.nii")
    np.testing.assert_allclose(found.affine, expected, rtol=1e-6, atol=1e-5 * millimetres)
    assert len(caught) == (millimetres != 1)  # the voxels are a metre or a micrometre long


def test_a_unit_that_is_none_is_refused(tmp_path):
    nifti(tmp_path / "a.nii", values(), unit="mm")
    content = bytearray((tmp_path / "a.nii").read_bytes())
    content[123] = 5
    (tmp_path / "a.nii").write_bytes(content)
    refuses("unit of length has the code 5", read_volume, tmp_path / "a.nii")


COLOUR = np.dtype([("R", "u1"), ("G", "u1"), ("B", "u1")])


def patched(path, place, content):
    """Overwrite some bytes of a NIfTI header: dims are 16-bit numbers from byte 42 on."""
    nifti(path, values())
    whole = bytearray(path.read_bytes())
    whole[place : place + len(content)] = content
    path.write_bytes(whole)


def surface_file(path):
    array = nibabel.gifti.GiftiDataArray(np.zeros((3, 3), np.float32), intent="NIFTI_INTENT_POINTSET")
    nibabel.save(nibabel.GiftiImage(darrays=[array]), path)


def cifti(path):
    axes = nibabel.cifti2.ScalarAxis(["a"]), nibabel.cifti2.SeriesAxis(0, 1, 5)
    nibabel.save(nibabel.Cifti2Image(np.zeros((1, 5), np.float32), axes), path)


def mgh(path, place=None, content=b""):
    nibabel.save(nibabel.MGHImage(values(), np.eye(4)), path)
    whole = bytearray(path.read_bytes())
    if place is None:
        whole = whole[:50]
    else:
        whole[place : place + len(content)] = content
    path.write_bytes(whole)


BAD = {
    "colours.nii": lambda p: nifti(p, np.zeros((3, 4, 5), COLOUR)),
    "complex.nii": lambda p: nifti(p, values().astype(np.complex64)),
    "dims.nii": lambda p: patched(p, 42, np.array([32767] * 3, "<i2").tobytes()),
    "zero.nii": lambda p: patched(p, 42, np.array([0, 4, 5], "<i2").tobytes()),
    "negative.nii": lambda p: patched(p, 42, np.array([-3, 4, 5], "<i2").tobytes()),
    "larger.nii": lambda p: patched(p, 42, np.array([19, 8, 7], "<i2").tobytes()),
    "series.nii": lambda p: nifti(p, values(3, 4, 5, 2)),
    "lh.surf.gii": surface_file,
    "a.dscalar.nii": cifti,
    "type.mgh": lambda p: mgh(p, 20, (2).to_bytes(4, "big")),
    "short.mgh": mgh,
    "dims.mgh": lambda p: mgh(p, 4, np.array([2000] * 3, ">i4").tobytes()),
    "junk.par": lambda p: p.write_bytes(b"junk\n" * 99),
    "a.nii.zst": lambda p: p.write_bytes(b"\x28\xb5\x2f\xfd" + bytes(99)),
    "a.nii.bz2": lambda p: p.write_bytes(b"BZh9" + bytes(99)),
    "folder.HEAD": lambda p: p.write_bytes(b""),
}


@pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("name", BAD)
def test_every_file_that_is_not_read_is_a_value_error(tmp_path, name):
    BAD[name](tmp_path / name)
    refuses(r"not a whole image that can be read|cannot be used", read_volume, tmp_path / name)


def packed(path, header: bytes, n_bytes: int):
    """A gzip stream of so many zeros behind a header, written without holding it."""
    stream = zlib.compressobj(9, wbits=31)
    with path.open("wb") as file:
        file.write(stream.compress(header))
        for _ in range(n_bytes >> 20):
            file.write(stream.compress(bytes(1 << 20)))
        file.write(stream.flush())


def test_bombs_are_not_unpacked(tmp_path, monkeypatch):
    """The ceilings are lowered, so that the test needs no bomb: 4 MiB, and 64³ voxels."""
    monkeypatch.setattr(io_checks, "LARGEST_BYTES", 1 << 22)
    monkeypatch.setattr(io_checks, "LARGEST_VOXELS", 1 << 18)
    nifti(tmp_path / "a.nii", np.zeros((200, 200, 200), np.uint8))
    (tmp_path / "large.nii.gz").write_bytes(gzip.compress((tmp_path / "a.nii").read_bytes()))
    refuses("more than 4 MiB unpacked", read_volume, tmp_path / "large.nii.gz")
    refuses("at most 512³ are read", read_volume, tmp_path / "a.nii")


def test_a_header_that_promises_more_than_the_stream_holds(tmp_path):
    """A small .mgz whose header says 400³ 32-bit voxels: refused by the size of the stream, before voxels are made."""
    nibabel.save(nibabel.MGHImage(np.zeros((2, 2, 2), np.float32), np.eye(4)), tmp_path / "a.mgh")
    whole = bytearray((tmp_path / "a.mgh").read_bytes())
    whole[4:16] = np.array([400] * 3, ">i4").tobytes()
    packed(tmp_path / "a.mgz", bytes(whole), 1 << 20)
    refuses("do not fit into the", read_volume, tmp_path / "a.mgz")


def test_voxels_in_a_file_of_their_own(tmp_path):
    image = nibabel.Nifti1Pair(values(), OBLIQUE)
    nibabel.save(image, tmp_path / "a.hdr")
    np.testing.assert_array_equal(read_volume(tmp_path / "a.hdr").data, values())
    (tmp_path / "a.img").write_bytes((tmp_path / "a.img").read_bytes()[:-40])
    refuses("do not fit into the", read_volume, tmp_path / "a.img")


@pytest.mark.parametrize("kind", [nibabel.Nifti1Image, nibabel.Nifti2Image])
@pytest.mark.parametrize("size", [None, 2**31 - 16, 4000, -16, 0])
def test_extensions_of_a_header_must_fit(tmp_path, kind, size):
    image = kind(values(), OBLIQUE)
    image.header.extensions.append(nibabel.nifti1.Nifti1Extension("comment", b"by hand" * 9))
    nibabel.save(image, tmp_path / "a.nii")
    content = bytearray((tmp_path / "a.nii").read_bytes())
    place = int.from_bytes(content[:4], "little") + 4
    assert int.from_bytes(content[place : place + 4], "little") == 80
    if size is None:
        np.testing.assert_array_equal(read_volume(tmp_path / "a.nii").data, values())
        return
    content[place : place + 4] = size.to_bytes(4, "little", signed=True)
    (tmp_path / "a.nii").write_bytes(content)
    refuses("an extension of its header declares", read_volume, tmp_path / "a.nii")


GOOD = np.random.default_rng(0).normal(50, 5, (12, 13, 14)).astype(np.float32)
PLACE = np.diag([4.0, 4.0, 4.0, 1.0])


def with_affine(change):
    affine = PLACE.copy()
    change(affine)
    return affine


def flat(affine):
    affine[:, 2] = 0


def parallel(affine):
    affine[:3, 1] = affine[:3, 0]


def bad(values):
    data = GOOD.copy()
    data[3, 4, 5] = values
    return data


def save(path, data, affine, code=1):
    image = nibabel.Nifti1Image(data, None)
    if affine is not None:
        image.header.set_sform(affine, code)
        image.header["pixdim"][1:4] = np.linalg.norm(affine[:3, :3], axis=0)
        image.header["qform_code"] = 0
    nibabel.save(image, path)


@pytest.mark.parametrize(
    ("data", "affine", "words"),
    [
        (np.full((12, 13, 14), 7, np.float32), PLACE, "7.0 everywhere"),
        (bad(np.nan), PLACE, "1 voxels that are NaN or infinite, the first at"),
        (bad(np.inf), PLACE, "1 voxels that are NaN or infinite"),
        (np.stack([GOOD, GOOD], axis=-1), PLACE, "three axes are needed: take one image"),
        (GOOD[0], PLACE, "three axes"),
        (GOOD, None, "neither sform nor qform"),
        (GOOD, with_affine(flat), "its sform hold NaN, zeros or no volume"),
        (GOOD, with_affine(parallel), "its sform hold NaN, zeros or no volume"),
    ],
    ids=["constant", "nan", "infinite", "4D", "2D", "no affine", "flat affine", "parallel axes"],
)
def test_bad_scans_are_refused_by_name(tmp_path, data, affine, words):
    save(tmp_path / "scan.nii.gz", data, affine)
    with pytest.raises(ValueError, match=words):
        standard_scan(read_volume(tmp_path / "scan.nii.gz"), volume_pyramid(mni152_t1(), 4)[-1])


def test_an_empty_scan_is_refused(tmp_path):
    refuses("empty", Volume, np.zeros((0, 4, 4), np.float32), PLACE)
    (tmp_path / "scan.nii").write_bytes(b"")
    refuses("not a whole image", read_volume, tmp_path / "scan.nii")


@pytest.mark.parametrize("kept", [0, 10, 200, 0.5, 0.99])
@pytest.mark.parametrize("name", ["scan.nii", "scan.nii.gz"])
def test_a_truncated_file_is_refused_wherever_it_ends(tmp_path, name, kept):
    write_volume(tmp_path / name, Volume(GOOD, PLACE))
    whole = (tmp_path / name).read_bytes()
    (tmp_path / name).write_bytes(whole[: int(kept * len(whole)) if kept < 1 else kept])
    refuses("not a whole image", read_volume, tmp_path / name)


@pytest.mark.parametrize("quick", [True, False])
@pytest.mark.parametrize("n_slices", [1, 3])
def test_a_few_slices_are_refused_by_their_extent(n_slices, quick):
    thin = Volume(GOOD[:, :, :n_slices], PLACE)
    words = f"moving image has 12 × 13 × {n_slices} voxels and spans 48 × 52 × {4 * n_slices} mm"
    refuses(words, standard_scan, thin, Volume(GOOD, PLACE), quick=quick)


def test_a_scan_that_is_elsewhere_is_refused():
    away = PLACE.copy()
    away[:3, 3] = 5000
    refuses("all over the standard grid", place_on_grid, Volume(GOOD, away), np.eye(4), np.zeros(3))


@pytest.mark.parametrize("affine", [OBLIQUE, FLIPPED], ids=["oblique", "flipped"])
def test_odd_affines_are_not_bad(tmp_path, affine):
    save(tmp_path / "scan.nii.gz", GOOD, affine)
    np.testing.assert_allclose(read_volume(tmp_path / "scan.nii.gz").affine, affine, atol=1e-6)
