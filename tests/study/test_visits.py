"""Visits: their names, and those of files and folders that are no BIDS data set."""

import subprocess
import sys
from pathlib import Path

import pytest

from meshot.study.bids import Visit, bare_label, entities_of, visits_of_files, visits_of_folder
from refusals import refuses


def test_the_names_of_a_visit():
    visit = Visit("01", "b", entities=(("acq", "mprage"), ("run", "1")))
    assert (visit.parts, visit.label) == (("sub-01", "ses-b"), "sub-01_ses-b")
    assert visit.prefix == "sub-01_ses-b_acq-mprage_run-1"
    assert Visit("01").prefix == Visit("01").label == "sub-01"


def test_entities_of_a_name():
    assert entities_of("sub-01_ses-2_acq-a_T1w.nii.gz") == {"sub": "01", "ses": "2", "acq": "a"}
    assert entities_of("scan-of-me_T1w.nii.gz") == {}


@pytest.mark.parametrize(("label", "expected"), [("01", "01"), ("sub-01", "01"), ("sub01", "sub01")])
def test_labels_with_and_without_their_kind(label, expected):
    assert bare_label(label, "sub") == expected


@pytest.mark.parametrize("label", ["", "sub-", "a b", "a/b", "../x"])
def test_what_is_no_label(label):
    refuses("is no label", bare_label, label, "sub")


def test_files_have_labels_by_their_names():
    names = ["sub-01_ses-02_T1w.nii.gz", "a head.nii", "OAS1_0001.mgz", "x_T1w.nii.gz"]
    found = visits_of_files([Path(name) for name in names])
    assert [visit.label for visit in found] == ["sub-01_ses-02", "sub-ahead", "sub-OAS10001", "sub-x"]
    assert [visit.scans for visit in found] == [(Path(name),) for name in names]


def test_files_that_would_be_the_same_are_refused():
    refuses("would both be sub-ab", visits_of_files, [Path("a_b.nii"), Path("ab.nii.gz")])
    refuses("no letter and no digit", visits_of_files, [Path("---.nii")])


def test_a_folder_of_scans(tmp_path):
    for name in ("b.nii", "a.nii.gz", "notes.txt"):
        (tmp_path / name).touch()
    assert [visit.label for visit in visits_of_folder(tmp_path)] == ["sub-a", "sub-b"]
    (tmp_path / "empty").mkdir()
    refuses("holds no scan", visits_of_folder, tmp_path / "empty")


@pytest.mark.parametrize("library", ["pathspec", "bidsschematools"])
def test_scans_that_are_no_data_set_need_no_library_of_bids(library):
    code = f"""import sys
from pathlib import Path
sys.modules[{library!r}] = None
from meshot.study import DESCRIPTION, visits_of_files, visits_of_folder
print(len(visits_of_files([Path("a.nii.gz"), Path("b.nii.gz")])))"""
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ended.stdout == "2\n"
