"""Any system is trained by its name on the command line, also one that the package does not know."""

import pytest

from meshot.cli import main
from meshot.model.segmentation import SegmentationNetwork
from meshot.model.weights import write_weights
from meshot.provenance import read_results
from meshot.systems import get_system
from phantoms import write_phantom_cohort


@pytest.fixture
def words(toys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_phantom_cohort(tmp_path / "few", ["train", "validation"])
    write_weights(tmp_path / "segmentation.safetensors", SegmentationNetwork(2, 1), {})
    (tmp_path / "c.yaml").write_text("training: {n_steps: 4}\n")
    return ["c.yaml", "--data", "few", "-o", "out", "--segmentation", "segmentation.safetensors", "--threads", "1"]


def test_a_template_is_trained_without_initial_surfaces(words, tmp_path, capsys):
    assert main(["train", "template", *words, "--device", "cpu"]) == 0
    said = capsys.readouterr().out
    assert said.startswith("placement: best after 4 steps: validation_loss ")
    assert said.endswith("weights in out\n")
    assert not (tmp_path / "build").exists()
    record = get_system("template").load(tmp_path / "out").parts["placement"].record
    assert record["command"] == (
        "meshot train template c.yaml --data few -o out --segmentation segmentation.safetensors --threads 1 "
        "--device cpu"
    )
    assert "segmentation_sha256" not in record["results"]
    assert read_results(tmp_path / "out" / "placement.json")["config"]["training"]["n_steps"] == 4
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        "placement.safetensors", "placement.json", "placement.log.jsonl", "placement.png", "state", "sessions.jsonl",
    }  # fmt: skip


def test_the_unknown_is_one_line(words, capsys):
    assert main(["train", "freehand", *words]) == 2
    assert "there is no system 'freehand'; known are chain, classical, cortexode, cortic" in capsys.readouterr().err
    assert main(["train", "template", "small", *words[1:]]) == 2
    assert "template has no setting 'small'; it has none, or name a YAML file" in capsys.readouterr().err
