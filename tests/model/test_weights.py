"""Weights on disk: they come back as they went, with their record, and broken files are named."""

import pytest
import safetensors.torch
import torch

from meshot.model.segmentation import SegmentationNetwork
from meshot.model.weights import halve_weights, read_weights, write_weights
from refusals import refuses


def test_weights_and_record_come_back(tmp_path):
    network = SegmentationNetwork(3, 2, 2, generator=5)
    write_weights(tmp_path / "w.safetensors", network, {"seed": 5, "commit": "abc"})
    again, record = read_weights(tmp_path / "w.safetensors", SegmentationNetwork)
    image = torch.rand(1, 1, 8, 8, 12)
    assert torch.equal(again(image), network(image))
    assert record == {"seed": 5, "commit": "abc", "network": {"width": 3, "depth": 2, "fold": 2}}


def test_no_more_than_ten_megabytes(tmp_path):
    refuses(r"13\.2 MB; at most 10 MB", write_weights, tmp_path / "w.safetensors", SegmentationNetwork(24, 4, 2), {})
    refuses("as JSON", write_weights, tmp_path / "w.safetensors", SegmentationNetwork(2, 1), {"loss": float("nan")})
    assert not list(tmp_path.iterdir())


def test_half_of_a_file_has_nearly_the_same_weights(tmp_path):
    network, (whole, half) = SegmentationNetwork(3, 2, 2, generator=5), (tmp_path / "w", tmp_path / "h")
    write_weights(whole, network, {"seed": 5})
    halve_weights(whole, half)
    again, record = read_weights(half, SegmentationNetwork)
    assert record["seed"] == 5
    for name, value in network.state_dict().items():
        assert torch.equal(again.state_dict()[name], value.half().float())
    assert half.stat().st_size < 0.6 * whole.stat().st_size
    with torch.no_grad():
        next(network.parameters())[0, 0, 0, 0, 0] = 1e5
    write_weights(whole, network, {})
    refuses("as float16 has 1 entries that are NaN or infinite", halve_weights, whole, half)
    whole.write_bytes(whole.read_bytes()[:-40])
    refuses("w is not a whole file of weights", halve_weights, whole, half)
    assert read_weights(half, SegmentationNetwork)[1]["seed"] == 5


def test_other_files_are_named(tmp_path):
    path = tmp_path / "w.safetensors"
    refuses(r"w\.safetensors does not hold the weights", read_weights, path, SegmentationNetwork)
    write_weights(path, SegmentationNetwork(2, 2), {})
    whole = path.read_bytes()
    path.write_bytes(whole[:-40])
    refuses("does not hold the weights", read_weights, path, SegmentationNetwork)
    safetensors.torch.save_file({"a": torch.zeros(2)}, path)
    refuses("does not hold the weights", read_weights, path, SegmentationNetwork)
    safetensors.torch.save_file(
        {"a": torch.zeros(2)}, path, metadata={"SegmentationNetwork": '{"network": {"width": 2}}'}
    )
    refuses("does not hold the weights", read_weights, path, SegmentationNetwork)


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
    refuses("does not hold the weights", read_weights, path, SegmentationNetwork)
