"""One command from a configuration and cohorts to weights, record, log and picture."""

import json

import pytest

from meshot.cli import main
from meshot.model.segmentation import SegmentationNetwork
from meshot.model.weights import network_digest, read_weights
from meshot.provenance import read_results
from meshot.train.engine import read_log
from phantoms import write_phantom_cohort

CONFIG = """
network: {width: 2, depth: 2, fold: 1}
training: {n_epochs: 2, learning_rate: 0.01, reduction: 2}
"""


@pytest.fixture
def words(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_phantom_cohort(tmp_path / "first", ["train", "validation", "test"])
    write_phantom_cohort(tmp_path / "second", ["train", "train"])
    (tmp_path / "c.yaml").write_text(CONFIG)
    return ["train-segmentation", "c.yaml", "--data", "first", "second", "-o", "out", "--threads", "1"]


def test_everything_is_written_with_its_provenance(words, tmp_path, capsys):
    assert main([*words, "--device", "cpu"]) == 0
    assert "best after" in capsys.readouterr().out
    network, record = read_weights(tmp_path / "out" / "segmentation.safetensors", SegmentationNetwork)
    results = read_results(tmp_path / "out" / "segmentation.json")
    assert network.config() == {"width": 2, "depth": 2, "fold": 1}
    command = "meshot train-segmentation c.yaml --data first second -o out --threads 1 --device cpu"
    assert record["command"] == results["command"] == command
    assert record["results"]["data"]["training"]["n_scans"] == 3
    assert record["results"]["n_steps"] == 6
    assert record["training"]["seed"] == 0
    assert record["cohorts"] == ["first", "second"]
    assert {"commit", "versions", "date", "machine"} <= set(record)
    assert len(record["results"]["data"]["validation"]["sha256"]) == 64
    assert str(tmp_path) not in json.dumps(record) + json.dumps(results)
    assert len(read_log(tmp_path / "out" / "segmentation.log.jsonl")) == 8
    assert (tmp_path / "out" / "segmentation.png").stat().st_size > 5000


def test_a_trained_network_learns_on_from_other_cohorts(words, tmp_path, capsys):
    assert main(words) == 0
    again = [*words[:3], "second", "first", "-o", "on", "--threads", "1", "--device", "cpu"]
    start = tmp_path / "out" / "segmentation.safetensors"
    assert main([*again, "--start", "out/segmentation.safetensors", "--set", "training.n_epochs=1"]) == 0
    first, _ = read_weights(start, SegmentationNetwork)
    found, record = read_weights(tmp_path / "on" / "segmentation.safetensors", SegmentationNetwork)
    assert record["results"]["start_sha256"] == network_digest(first) != network_digest(found)
    assert "-o on --start out/segmentation.safetensors --threads 1" in record["command"]
    capsys.readouterr()
    assert main([*again[:-2], "--start", "nowhere.safetensors"]) == 2
    assert "nowhere.safetensors does not hold the weights of a SegmentationNetwork" in capsys.readouterr().err


def test_what_will_not_do_is_one_line(words, tmp_path, capsys):
    (tmp_path / "c.yaml").write_text("network: {width: 0}")
    assert main(words) == 2
    assert "is invalid" in capsys.readouterr().err
    (tmp_path / "c.yaml").write_text(CONFIG.replace("0.01", "1.0e+30"))
    assert main(words) == 2
    assert "is not finite" in capsys.readouterr().err
    assert main([*words[:-1], "0"]) == 2
    assert main([*words, "--device", "nothing"]) == 2
    assert "--device nothing: " in capsys.readouterr().err
    assert main([*words[:3], str(tmp_path / "none"), *words[5:]]) == 2
    assert "is no cohort" in capsys.readouterr().err
