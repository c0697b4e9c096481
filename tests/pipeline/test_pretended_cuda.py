"""A whole reconstruction with its networks on a pretended CUDA device: the same surfaces as on the processor.

With ``MESHOT_SYSTEMS=all`` in the environment every system of the registry is tried, which takes three minutes. Without
it, the one that is the default and one that starts from a template are.
"""

import json
import os

import numpy as np
import pytest
import torch

from bids_trials import SHAPE, TURNED, add_scan, network_words, new_dataset
from bright_head import balls, bright_head, bright_template, write_bright_weights
from meshot import read_mesh
from meshot.cli import main
from meshot.pipeline import load_networks, page as pictures, reconstruct, reconstruction, report as report_files
from meshot.study import StudySettings, many_visits as one_visit
from meshot.study.quality import read_subjects
from meshot.systems import Example, ExampleSets, Scan, get_system, read_settings, system_names
from meshot.volume import standard_scan
from meshot.volume.io import write_volume
from pretended_cuda import pretended_cuda

SYSTEMS = system_names() if os.environ.get("MESHOT_SYSTEMS") == "all" else ("windows", "vox2cortex")
#: Settings of a training so short that it only gives networks that find something.
SHORT = {
    "deepcsr": ["training.n_epochs=8"],
    "vox2cortex": ["training.n_epochs=1"],
    "corticalflow": ["training.n_epochs=1", "training.n_flow_steps=2"],
    "classical": ["training.n_epochs=2"],
}


@pytest.fixture(scope="module")
def scan():
    return bright_head(TURNED, SHAPE)


@pytest.fixture(scope="module")
def standard(scan):
    return standard_scan(scan, bright_template(), quick=True)


@pytest.fixture(scope="module")
def bright(tmp_path_factory):
    return write_bright_weights(tmp_path_factory.mktemp("cuda") / "weights")


@pytest.fixture(scope="module")
def weights_of(bright, standard, tmp_path_factory):
    """The folder of the weights of a system: made by hand for those of flows from initial surfaces."""

    def folder(name):
        kind = get_system(name)
        if kind.needs:
            return bright
        truth = {(side, "white"): mesh.to(torch.float32) for side, mesh in balls(np.eye(4)).items()}
        example = Example("head", Scan(standard.volume, {}), truth)
        settings = read_settings(kind, "tiny", SHORT[name])
        made = tmp_path_factory.mktemp(name) / "weights"
        kind.train(ExampleSets([example], [example]), settings, device=torch.device("cpu")).save(made)
        return made

    return folder


# The system of the package's networks in make test; the others in make test-all.
@pytest.mark.parametrize(
    "name", [name if name == "windows" else pytest.param(name, marks=pytest.mark.thorough) for name in SYSTEMS]
)
def test_every_system_finds_the_same_surfaces(name, scan, standard, bright, weights_of, monkeypatch):
    monkeypatch.setattr(reconstruction, "standard_scan", lambda *_, **__: standard)
    weights, found = weights_of(name), {}
    for device in ("cpu", "cuda"):
        with pretended_cuda() as operations:
            networks = load_networks(name, weights, bright / "segmentation.safetensors", device=device)
            operations.clear()
            found[device] = reconstruct(scan, networks.segmentation, networks.system, template=bright_template())
            assert (operations["aten.convolution.default"] > 0) == (device == "cuda")
    for side, surface in found["cuda"].surfaces.items():
        expected = found["cpu"].surfaces[side]
        assert type(surface.final.vertices) is torch.Tensor
        assert torch.equal(surface.initial.vertices, expected.initial.vertices)
        assert torch.equal(surface.final.faces, expected.final.faces)
        # Flows from initial surfaces convolve the whole image on a GPU, and only visited voxels on a processor.
        torch.testing.assert_close(surface.final.vertices, expected.final.vertices, rtol=0, atol=1e-4)
    assert found["cuda"].warnings == found["cpu"].warnings


@pytest.fixture
def small(monkeypatch):
    """A template of 4 mm, and a page with one slice."""
    for module in (one_visit, reconstruction, report_files):
        monkeypatch.setattr(module, "mni152_t1", bright_template)
    monkeypatch.setattr(pictures, "_CUTS", (("axial", 0.5),))
    monkeypatch.setattr(report_files, "surface_view", lambda *_: "<p>surfaces</p>")


@pytest.fixture
def reconstructed(scan, bright, small, tmp_path):
    """Runs the command on one scan or on a data set, on a device; the folder with the surfaces."""
    settings = StudySettings(weights=bright, segmentation=bright / "segmentation.safetensors")
    write_volume(tmp_path / "scan.nii.gz", scan)
    add_scan(new_dataset(tmp_path / "raw"), "sub-01_T1w.nii.gz", tmp_path / "scan.nii.gz")

    def run(bids, device):
        out = tmp_path / f"{device} {bids}"
        words = [str(tmp_path / "raw"), str(out), "participant"]
        words = words if bids else [str(tmp_path / "scan.nii.gz"), "-o", str(out)]
        with pretended_cuda() as operations:
            assert main(["reconstruct", *words, *network_words(settings), "--device", device]) == 0
            assert (operations["aten.convolution.default"] > 0) == (device == "cuda")
        return out / "sub-01" if bids else out

    return run


@pytest.mark.thorough
def test_the_command_line_writes_the_same(reconstructed, capsys):
    expected = reconstructed(False, "cpu")
    said = [json.loads((expected / "report.json").read_text(encoding="utf-8"))["warnings"]]
    for folder in (reconstructed(False, "cuda"), reconstructed(True, "cuda")):
        for side in ("lh", "rh"):
            one, other = (read_mesh(place / f"{side}.white") for place in (folder, expected))
            torch.testing.assert_close(one.vertices, other.vertices, rtol=0, atol=1e-4)
        said.append(json.loads((folder / "report.json").read_text(encoding="utf-8"))["warnings"])
    assert said[0] == said[1]
    assert set(said[0]) <= set(said[2])  # a study says more
    assert [row["status"] for row in read_subjects(folder.parent)] == ["done"]


def test_a_second_device_that_is_not_there_is_refused(bright, tmp_path, capsys):
    settings = StudySettings(weights=bright, segmentation=bright / "segmentation.safetensors")
    with pretended_cuda():
        words = ["reconstruct", "scan.nii.gz", "-o", str(tmp_path / "out"), *network_words(settings)]
        assert main([*words, "--device", "cuda:7"]) == 2
    said = capsys.readouterr().err
    assert (
        "--device cuda:7: PyTorch cannot compute there (CUDA error: invalid device ordinal); use cpu or cuda:0" in said
    )
    assert not (tmp_path / "out").exists()
