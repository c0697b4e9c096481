"""Images through files; bad, damaged and too large ones are refused with one clear error, and soon."""

import gzip

import nibabel
import numpy as np
import pytest

from affines import FLIPPED, OBLIQUE
from meshot.volume import io as io_checks
from meshot.volume.io import read_volume, write_volume
from meshot.volume.registration import standard_scan
from meshot.volume.volume import Volume
from refusals import refuses

GOOD = Volume(np.random.default_rng(0).normal(50, 5, (12, 13, 14)).astype(np.float32), np.diag([4.0, 4.0, 4.0, 1.0]))
SQUARE = np.diag([-1.2, 1.0, 0.9, 1.0])[[0, 2, 1, 3]] + np.pad([[30.0], [-4], [2], [0]], [(0, 0), (3, 0)])


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


def test_other_files_are_refused(tmp_path):
    volume = Volume(np.zeros((4, 5, 6)), OBLIQUE)
    refuses(r"\.nii, \.nii\.gz, \.mgh or \.mgz", write_volume, tmp_path / "a.png", volume)
    refuses("not orthogonal", write_volume, tmp_path / "a.mgz", volume)
    refuses("does not exist", read_volume, tmp_path / "missing.nii")


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


@pytest.mark.parametrize("name", ["a.nii.gz", "a.mgz"])
def test_every_flipped_bit_of_a_compressed_scan_is_seen(tmp_path, name):
    nibabel.save((nibabel.MGHImage if name == "a.mgz" else nibabel.Nifti1Image)(GOOD.data, OBLIQUE), tmp_path / name)
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


def test_bombs_are_not_unpacked(tmp_path, monkeypatch):
    """The ceilings are lowered, so that the test needs no bomb: 4 MiB, and 64³ voxels."""
    monkeypatch.setattr(io_checks, "LARGEST_BYTES", 1 << 22)
    monkeypatch.setattr(io_checks, "LARGEST_VOXELS", 1 << 18)
    nibabel.save(nibabel.Nifti1Image(np.zeros((200, 200, 200), np.uint8), OBLIQUE), tmp_path / "a.nii")
    (tmp_path / "large.nii.gz").write_bytes(gzip.compress((tmp_path / "a.nii").read_bytes()))
    refuses("more than 4 MiB unpacked", read_volume, tmp_path / "large.nii.gz")
    refuses("at most 512³ are read", read_volume, tmp_path / "a.nii")


@pytest.mark.parametrize("quick", [True, False])
@pytest.mark.parametrize("n_slices", [1, 3])
def test_a_few_slices_are_refused_by_their_extent(n_slices, quick):
    thin = Volume(GOOD.data[:, :, :n_slices], GOOD.affine)
    words = f"moving image has 12 × 13 × {n_slices} voxels and spans 48 × 52 × {4 * n_slices} mm"
    refuses(words, standard_scan, thin, GOOD, quick=quick)
