"""Images through files, and what is refused."""

import nibabel
import numpy as np
import pytest

from affines import FLIPPED, OBLIQUE
from meshot.volume.io import read_volume, write_volume
from meshot.volume.volume import Volume


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
    with pytest.raises(ValueError, match=r"2\.nii cannot be used: it has shape .*three axes"):
        read_volume(tmp_path / "2.nii")


def test_broken_files_are_refused(tmp_path):
    write_volume(tmp_path / "a.nii.gz", Volume(np.random.default_rng(0).normal(size=(20, 20, 20)), np.eye(4)))
    whole = (tmp_path / "a.nii.gz").read_bytes()
    (tmp_path / "half.nii.gz").write_bytes(whole[: len(whole) // 2])
    write_volume(tmp_path / "a.nii", Volume(np.ones((20, 20, 20)), np.eye(4)))
    (tmp_path / "half.nii").write_bytes((tmp_path / "a.nii").read_bytes()[:9000])
    (tmp_path / "garbage.nii").write_bytes(b"no image" * 100)
    (tmp_path / "empty.nii.gz").write_bytes(b"")
    for name in ("half.nii.gz", "half.nii", "garbage.nii", "empty.nii.gz"):
        with pytest.raises(ValueError, match="not a whole image"):
            read_volume(tmp_path / name)
    with pytest.raises(ValueError, match="does not exist"):
        read_volume(tmp_path / "missing.nii")


def test_an_image_without_a_place_is_refused(tmp_path):
    nibabel.save(nibabel.Nifti1Image(np.zeros((3, 4, 5), np.float32), None), tmp_path / "a.nii")
    with pytest.raises(ValueError, match="neither sform nor qform"):
        read_volume(tmp_path / "a.nii")


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
    with pytest.raises(ValueError, match="not orthogonal"):
        write_volume(tmp_path / "a.mgz", Volume(np.zeros((4, 5, 6)), OBLIQUE))
