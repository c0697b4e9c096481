"""Weights on disk: they come back as they went, with their record, and broken files are named."""

import pytest
import safetensors.torch
import torch

from meshot.model.segmentation import SegmentationNetwork
from meshot.model.weights import read_weights, write_weights


def test_weights_and_record_come_back(tmp_path):
    network = SegmentationNetwork(3, 2, 2, generator=5)
    write_weights(tmp_path / "w.safetensors", network, {"seed": 5, "commit": "abc"})
    again, record = read_weights(tmp_path / "w.safetensors", SegmentationNetwork)
    image = torch.rand(1, 1, 8, 8, 12)
    assert torch.equal(again(image), network(image))
    assert record == {"seed": 5, "commit": "abc", "network": {"width": 3, "depth": 2, "fold": 2}}


def test_no_more_than_ten_megabytes(tmp_path):
    with pytest.raises(ValueError, match=r"13\.2 MB; at most 10 MB"):
        write_weights(tmp_path / "w.safetensors", SegmentationNetwork(24, 4, 2), {})
    with pytest.raises(ValueError, match="as JSON"):
        write_weights(tmp_path / "w.safetensors", SegmentationNetwork(2, 1), {"loss": float("nan")})
    assert not list(tmp_path.iterdir())


def test_other_files_are_named(tmp_path):
    path = tmp_path / "w.safetensors"
    with pytest.raises(ValueError, match=r"w\.safetensors does not hold the weights"):
        read_weights(path, SegmentationNetwork)
    write_weights(path, SegmentationNetwork(2, 2), {})
    whole = path.read_bytes()
    path.write_bytes(whole[:-40])
    with pytest.raises(ValueError, match="does not hold the weights"):
        read_weights(path, SegmentationNetwork)
    safetensors.torch.save_file({"a": torch.zeros(2)}, path)
    with pytest.raises(ValueError, match="does not hold the weights"):
        read_weights(path, SegmentationNetwork)
    safetensors.torch.save_file(
        {"a": torch.zeros(2)}, path, metadata={"SegmentationNetwork": '{"network": {"width": 2}}'}
    )
    with pytest.raises(ValueError, match="does not hold the weights"):
        read_weights(path, SegmentationNetwork)


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_weights_that_are_no_numbers_are_refused(tmp_path, value):
    network = SegmentationNetwork(2, 2)
    with torch.no_grad():
        next(network.parameters()).view(-1)[0] = value
    write_weights(tmp_path / "w.safetensors", network, {})
    with pytest.raises(ValueError, match=r"does not hold the weights .*NaN or infinite"):
        read_weights(tmp_path / "w.safetensors", SegmentationNetwork)


@pytest.mark.parametrize("header", ["[" * 100_000, '{"network": {"width": 1000000000}}', '{"network": []}', "3"])
def test_records_that_are_none_are_refused(tmp_path, header):
    path = tmp_path / "w.safetensors"
    safetensors.torch.save_file({"a": torch.zeros(2)}, path, metadata={"SegmentationNetwork": header})
    with pytest.raises(ValueError, match="does not hold the weights"):
        read_weights(path, SegmentationNetwork)
