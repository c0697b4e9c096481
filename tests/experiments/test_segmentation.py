"""The experiment on held-out subjects, run on phantoms: every number is there."""

import json
from pathlib import Path

import torch

from meshot.model.segmentation import SegmentationNetwork
from meshot.model.weights import write_weights
from meshot.provenance import read_results
from phantoms import write_phantom_cohort

FOLDER = Path(__file__).resolve().parents[2] / "experiments" / "segmentation"
RECORD = {
    "command": "", "commit": "", "date": "", "training": "", "cohorts": "", "machine": "",
    "results": {"best_step": 1, "n_steps": 2, "cpu_seconds": 3.0, "data": {}},
}  # fmt: skip


class Bright(SegmentationNetwork):
    """In place of a trained network: bright voxels on either side of the middle."""

    def forward(self, image):
        inside = 20 * (torch.nn.functional.avg_pool3d(image, 3, 1, 1) - 0.6)
        side = torch.where(torch.arange(image.shape[2]) < image.shape[2] / 2, 1.0, 0.0)[:, None, None]
        return torch.cat([torch.zeros_like(image), inside - 50 * (1 - side), inside - 50 * side], dim=1)


def test_every_hemisphere_is_measured(tmp_path, run, monkeypatch):
    cohort = write_phantom_cohort(tmp_path / "phantoms", ["test", "train", "test"])
    weights, output = tmp_path / "w.safetensors", tmp_path / "results.json"
    write_weights(weights, SegmentationNetwork(2, 1), RECORD)
    real = run.read_weights
    monkeypatch.setattr(run, "read_weights", lambda path, kind: (Bright(2, 1), real(path, kind)[1]))
    words = ["--set", f"cohorts=[{cohort}]", f"weights={weights}", "--output", str(output)]
    run.main(words)
    record = read_results(output)
    rows = record["results"]["hemispheres"]
    assert [(row["subject"], row["side"]) for row in rows] == [
        (f"phantoms/sub-{i}", side) for i in ("001", "003") for side in ("left", "right")
    ]
    for row in rows:
        assert (row["euler_number"], row["nonmanifold_edges"], row["self_intersecting_faces"]) == (2, 0, 0)
        assert row["dice"] > 0.85
        assert row["from_truth_alone"]["assd_mm"] < 0.2
        assert row["from_truth_alone"]["assd_mm"] < row["assd_mm"] < 0.6
    (line,) = record["results"]["summary"]
    assert (line["cohort"], line["kind"], line["n_hemispheres"]) == ("phantoms", "template", 4)
    assert line["all_spheres"]
    assert line["least_dice"] == min(row["dice"] for row in rows)
    assert line["n_below_dice"] == sum(row["dice"] < 0.95 for row in rows)
    assert json.dumps(record["results"]["weights"])


def test_the_summary_sees_each_failure(run):
    good = {
        "subject": "a/sub-001", "kind": "template", "dice": 0.97, "assd_mm": 0.3, "euler_number": 2, "components": 1,
        "nonmanifold_edges": 0, "boundary_edges": 0, "self_intersecting_faces": 0,
        "from_truth_alone": {"assd_mm": 0.1},
    }  # fmt: skip
    (line,) = run.summary([good, good])
    assert line["all_spheres"]
    assert (line["n_self_intersecting"], line["n_below_dice"], line["n_above_assd"]) == (0, 0, 0)
    for key, value in (("euler_number", 0), ("components", 2), ("nonmanifold_edges", 1), ("boundary_edges", 3)):
        assert not run.summary([good, good | {key: value}])[0]["all_spheres"]
    assert run.summary([good | {"self_intersecting_faces": 4}])[0]["n_self_intersecting"] == 1
    assert run.summary([good | {"dice": 0.94}, good])[0]["n_below_dice"] == 1
    assert run.summary([good | {"assd_mm": 0.61}, good])[0]["n_above_assd"] == 1
    assert len(run.summary([good, good | {"kind": "procedural"}, good | {"subject": "b/sub-001"}])) == 3
