"""Every bad scan that someone may bring: from the file to the standard grid, one clear error each."""

import nibabel
import numpy as np
import pytest

from affines import FLIPPED, OBLIQUE
from meshot.anatomy.templates import mni152_t1
from meshot.volume.io import read_volume, write_volume
from meshot.volume.registration import place_on_grid, standard_scan
from meshot.volume.volume import Volume, volume_pyramid

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
        (GOOD, with_affine(flat), "singular"),
        (GOOD, with_affine(parallel), "singular"),
    ],
    ids=["constant", "nan", "infinite", "4D", "2D", "no affine", "flat affine", "parallel axes"],
)
def test_bad_scans_are_refused_by_name(tmp_path, data, affine, words):
    save(tmp_path / "scan.nii.gz", data, affine)
    with pytest.raises(ValueError, match=words):
        standard_scan(read_volume(tmp_path / "scan.nii.gz"), volume_pyramid(mni152_t1(), 4)[-1])


def test_an_empty_scan_is_refused(tmp_path):
    with pytest.raises(ValueError, match="empty"):
        Volume(np.zeros((0, 4, 4), np.float32), PLACE)
    (tmp_path / "scan.nii").write_bytes(b"")
    with pytest.raises(ValueError, match="not a whole image"):
        read_volume(tmp_path / "scan.nii")


@pytest.mark.parametrize("kept", [0, 10, 200, 0.5, 0.99])
@pytest.mark.parametrize("name", ["scan.nii", "scan.nii.gz"])
def test_a_truncated_file_is_refused_wherever_it_ends(tmp_path, name, kept):
    write_volume(tmp_path / name, Volume(GOOD, PLACE))
    whole = (tmp_path / name).read_bytes()
    (tmp_path / name).write_bytes(whole[: int(kept * len(whole)) if kept < 1 else kept])
    with pytest.raises(ValueError, match="not a whole image"):
        read_volume(tmp_path / name)


@pytest.mark.parametrize("quick", [True, False])
@pytest.mark.parametrize("n_slices", [1, 3])
def test_a_few_slices_are_refused_by_their_extent(n_slices, quick):
    thin = Volume(GOOD[:, :, :n_slices], PLACE)
    words = f"moving image has 12 × 13 × {n_slices} voxels and spans 48 × 52 × {4 * n_slices} mm"
    with pytest.raises(ValueError, match=words):
        standard_scan(thin, Volume(GOOD, PLACE), quick=quick)


def test_a_scan_that_is_elsewhere_is_refused():
    away = PLACE.copy()
    away[:3, 3] = 5000
    with pytest.raises(ValueError, match="all over the standard grid"):
        place_on_grid(Volume(GOOD, away), np.eye(4), np.zeros(3))


@pytest.mark.parametrize("affine", [OBLIQUE, FLIPPED], ids=["oblique", "flipped"])
def test_odd_affines_are_not_bad(tmp_path, affine):
    save(tmp_path / "scan.nii.gz", GOOD, affine)
    np.testing.assert_allclose(read_volume(tmp_path / "scan.nii.gz").affine, affine, atol=1e-6)
