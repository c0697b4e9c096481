"""Every file of a scan in the conformance set is read as it stands, or refused for its reason."""

import re
import warnings

import nibabel
import numpy as np
import pytest
from volume_files import SCANS, Scan

from meshot.file_facts import FileWarning
from meshot.volume import read_volume, volume_facts


@pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("scan", SCANS, ids=lambda scan: scan.name)
def test_a_file_of_a_scan(scan: Scan, tmp_path, capfd):
    path = tmp_path / scan.name
    for name, content in ((scan.name, scan.content), *scan.beside):
        (tmp_path / name).write_bytes(content)
    if scan.refused:
        with pytest.raises(ValueError, match=re.escape(scan.refused)) as refusal:
            read_volume(path)
        assert str(refusal.value).startswith(str(path))
        return
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        volume = read_volume(path)
    np.testing.assert_array_equal(volume.data, scan.values)
    np.testing.assert_allclose(volume.affine, scan.affine, rtol=1e-6, atol=1e-5)
    assert [warning.category for warning in caught if warning.category is not ResourceWarning] == [FileWarning] * bool(
        scan.fault
    )
    facts = volume_facts(path)
    assert (scan.fault in facts.faults[0]) if scan.fault else not facts.faults
    assert scan.about in "; ".join([facts.format, facts.space, facts.said_by, ", ".join(facts.not_read)])
    if scan.fault:
        with pytest.raises(ValueError, match="read strictly"):
            read_volume(path, strict=True)
    else:
        read_volume(path, strict=True)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    "name", ["plain.nii", "qform_only.nii", "qfac_minus_1.nii", "nifti2.nii", "type_i2.nii", "plain.mgz"]
)
def test_nibabel_finds_the_same(name, tmp_path):
    """So that the files themselves are right."""
    scan = next(scan for scan in SCANS if scan.name == name)
    (tmp_path / name).write_bytes(scan.content)
    image = nibabel.load(tmp_path / name)
    np.testing.assert_array_equal(image.get_fdata(), scan.values)
    np.testing.assert_allclose(image.affine, scan.affine, rtol=1e-6)
