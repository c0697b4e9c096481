"""A small BIDS data set of heads of two balls, and one reconstruction of such a head, made once."""

import pytest

from bids_trials import SHAPE, TURNED, add_scan, new_dataset
from bright_head import bright_head, bright_template, write_bright_weights
from meshot.pipeline import load_networks, page as pictures, reconstruct, report as report_files
from meshot.study import (
    StudySettings,
    layouts as bids_derivatives,
    layouts as freesurfer_subject,
    many_visits as one_visit,
)
from meshot.volume.io import write_volume


@pytest.fixture(scope="session")
def turned_scan(tmp_path_factory):
    path = tmp_path_factory.mktemp("turned") / "scan.nii.gz"
    write_volume(path, bright_head(TURNED, SHAPE))
    return path


@pytest.fixture
def dataset(tmp_path, turned_scan):
    """Two participants, one with two sessions, and one whose file was cut off."""
    folder = new_dataset(tmp_path / "raw")
    for name in ("sub-01_ses-a_T1w.nii.gz", "sub-01_ses-b_T1w.nii", "sub-02_T1w.nii.gz"):
        add_scan(folder, name, turned_scan)
    broken = add_scan(folder, "sub-03_T1w.nii.gz", turned_scan)
    broken.write_bytes(broken.read_bytes()[:2000])
    return folder


@pytest.fixture(scope="session")
def weights(tmp_path_factory):
    return write_bright_weights(tmp_path_factory.mktemp("bright") / "weights")


@pytest.fixture
def settings(weights):
    return StudySettings(system="ddot", weights=weights, segmentation=weights / "segmentation.safetensors")


@pytest.fixture(scope="session")
def networks(weights):
    return load_networks("ddot", weights, weights / "segmentation.safetensors")


@pytest.fixture(scope="session")
def found(networks):
    """A reconstruction of the turned head."""
    head = bright_head(TURNED, SHAPE)
    return reconstruct(head, networks.segmentation, networks.system, template=bright_template())


@pytest.fixture(autouse=True)
def small_template(monkeypatch):
    for module in (one_visit, report_files, freesurfer_subject, bids_derivatives):
        monkeypatch.setattr(module, "mni152_t1", bright_template)


@pytest.fixture
def quick(found, monkeypatch):
    """For what happens around a reconstruction: the one that was made, and a single slice."""
    monkeypatch.setattr(one_visit, "reconstruct", lambda *_: found)
    monkeypatch.setattr(pictures, "_CUTS", (("axial", 0.5),))
    monkeypatch.setattr(report_files, "surface_view", lambda *_: "<p>surfaces</p>")
