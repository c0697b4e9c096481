"""Systems on whole scans on the command line: they need their surfaces, and are used on weights of one's own."""

import json

import nibabel
import numpy as np
import pytest
import torch

from bright_head import balls, bright_template, brightness_network
from meshot.cli import main
from meshot.mesh.io import read_mesh
from meshot.metrics.distances import vertex_distances
from meshot.model.segmentation import SegmentationNetwork
from meshot.model.weights import write_weights
from meshot.pipeline import reconstruction
from meshot.systems import Part, get_system
from meshot.systems.learning import mean_box
from meshot.systems.vox2cortex import MeshNetwork
from meshot.volume.io import write_volume
from phantoms import pial_surfaces, write_phantom_cohort


def test_a_cohort_without_pial_surfaces_is_refused(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_phantom_cohort(tmp_path / "few", ["train", "validation"])
    write_weights(tmp_path / "segmentation.safetensors", SegmentationNetwork(2, 1), {})
    words = ["tiny", "--data", "few", "-o", "out", "--segmentation", "segmentation.safetensors", "--threads", "1"]
    assert main(["train", "vox2cortex", *words, "--set", "template.surfaces=[white, pial]"]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert (
        "few has no true left pial surface of sub-001 (sub-001_hemi-L_pial.surf.gii does not exist): make the" in said
    )


@pytest.mark.parametrize("pial", [pytest.param(False, marks=pytest.mark.thorough), True], ids=["white", "pial"])
def test_a_system_finds_surfaces_by_its_name(pial, tmp_path, monkeypatch, capsys):
    """Templates that no network moves yet lie in the boxes of the two balls, and these are what is found."""
    monkeypatch.setattr(reconstruction, "mni152_t1", bright_template)
    truths = balls(np.eye(4))
    boxes = {side: mean_box([mesh]) for side, mesh in truths.items()}
    boxes |= {f"{side}_pial": mean_box([mesh]) for side, mesh in pial_surfaces(truths).items()}
    template = {"shape": "sphere", "surfaces": ["white", "pial"] if pial else ["white"]}
    network = MeshNetwork(2, 2, 2, 4, 1, template, boxes)
    get_system("vox2cortex")({"meshes": Part(network, {"template": template})}).save(tmp_path / "weights")
    write_weights(tmp_path / "segmentation.safetensors", brightness_network(), {})
    write_volume(tmp_path / "head.nii.gz", bright_template())
    words = ["--weights", str(tmp_path / "weights"), "--segmentation", str(tmp_path / "segmentation.safetensors")]
    torch.set_num_threads(1)
    scan, out = str(tmp_path / "head.nii.gz"), tmp_path / "out"
    assert main(["reconstruct", scan, "-o", str(out), "--system", "vox2cortex", *words]) == 0
    (place,) = {path.parent for path in out.rglob("lh.white.surf.gii")}
    for side, mesh in truths.items():
        found = read_mesh(place / f"{side[0]}h.white.surf.gii")
        assert len(found.faces) == 20 * 4**5
        assert vertex_distances(found, mesh).mean() < 1.0
    report = json.loads((out / "report.json").read_text(encoding="utf-8"))
    assert report["system"] == "vox2cortex"
    said, page = capsys.readouterr().out, (out / "report.html").read_text(encoding="utf-8")
    assert ("White and pial surfaces of" in page) == ("left, pial: χ = 2" in said) == pial
    assert all((f"{letter}h.pial" in page) == pial for letter in "lr")
    assert len(list(place.glob("?h.pial*"))) == (6 if pial else 0)
    for side, mesh in pial_surfaces(truths).items() if pial else ():
        path = place / f"{side[0]}h.pial.surf.gii"
        assert vertex_distances(read_mesh(path), mesh).mean() < 1.0
        points = nibabel.load(path).darrays[0]
        assert points.meta["AnatomicalStructureSecondary"] == "Pial"
        numbers = report["surfaces"][side]["pial"]
        assert numbers["distance_from_white_mm"]["mean"] == pytest.approx(1.0, abs=0.1)
        assert numbers["volume_cm3"] > report["surfaces"][side]["final"]["volume_cm3"]
        assert f'<th scope="col">{side}, pial</th>' in page
    assert pial or all(numbers["pial"] is None for numbers in report["surfaces"].values())
