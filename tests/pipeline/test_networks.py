"""Where the trained networks of a reconstruction come from."""

import shutil

import pytest

from bright_head import write_bright_weights
from meshot.model.deformation import DeformationNetwork
from meshot.model.segmentation import SegmentationNetwork
from meshot.model.weights import network_digest, read_weights, write_weights
from meshot.pipeline import networks as shipped
from meshot.pipeline.deformation.settings import read_deformation_config
from meshot.pipeline.networks import DEFORMATION, SEGMENTATION, load_networks, weights_path
from meshot.provenance import read_results


@pytest.fixture
def folder(tmp_path):
    return write_bright_weights(tmp_path / "weights")


def test_networks_come_with_their_records(folder):
    networks = load_networks(folder)
    assert set(networks.deformation) == {"left", "right"}
    assert networks.segmentation.config() == {"width": 1, "depth": 1, "fold": 1}
    assert set(networks.records) == {SEGMENTATION, *DEFORMATION.values()}
    assert networks.records[SEGMENTATION]["command"] == "made by hand"


def test_without_deformation_its_files_are_not_needed(folder):
    for name in DEFORMATION.values():
        (folder / name).unlink()
    assert load_networks(folder, with_deformation=False).deformation is None
    with pytest.raises(
        ValueError, match=r"deformation_left.safetensors are missing: there is none in .*--initial-only"
    ):
        load_networks(folder)


def test_the_shipped_ones_are_used_if_no_folder_is_named(folder, monkeypatch):
    monkeypatch.setattr(shipped, "SHIPPED", folder)
    assert weights_path(SEGMENTATION) == folder / SEGMENTATION
    assert load_networks().records[SEGMENTATION]["command"] == "made by hand"
    (folder / SEGMENTATION).unlink()
    with pytest.raises(ValueError, match="this installation came without them"):
        load_networks()


def test_sides_are_not_taken_for_a_segmentation(folder):
    shutil.copy(folder / DEFORMATION["left"], folder / SEGMENTATION)
    with pytest.raises(ValueError, match="does not hold the weights of a SegmentationNetwork"):
        load_networks(folder)


def with_record(folder, side, record):
    path = folder / DEFORMATION[side]
    write_weights(path, read_weights(path, DeformationNetwork)[0], record)


def test_the_flow_of_the_other_side_is_refused(folder):
    with_record(folder, "right", {"training": {"side": "right"}})
    load_networks(folder)
    with_record(folder, "right", {"training": {"side": "left"}})
    with pytest.raises(ValueError, match=r"deformation_right.* holds the flow of the left side; that of the right"):
        load_networks(folder)


def test_a_flow_from_other_initial_surfaces_is_refused(folder):
    segmentation = read_weights(folder / SEGMENTATION, SegmentationNetwork)[0]
    with_record(folder, "left", {"results": {"segmentation_sha256": network_digest(segmentation)}})
    load_networks(folder)
    with_record(folder, "left", {"results": {"segmentation_sha256": "0" * 64}})
    with pytest.raises(ValueError, match=r"deformation_left.* learned from initial surfaces of another network than"):
        load_networks(folder)


def test_flows_are_integrated_as_they_were_learned(folder):
    assert (load_networks(folder).n_steps, load_networks(folder).method) == (10, "euler")
    with_record(folder, "left", {"training": {"n_flow_steps": 4, "method": "rk4"}})
    with pytest.raises(ValueError, match="both sides need the same: train one of them anew"):
        load_networks(folder)
    with_record(folder, "right", {"training": {"n_flow_steps": 4, "method": "rk4"}})
    assert (load_networks(folder).n_steps, load_networks(folder).method) == (4, "rk4")


@pytest.mark.parametrize("group", ["training", "results"])
@pytest.mark.parametrize("content", [None, 3, "left", ["side"]])
def test_a_record_whose_groups_are_none_is_refused(folder, group, content):
    with_record(folder, "left", {group: content})
    with pytest.raises(ValueError, match=f"says of its {group} .*names and values are needed"):
        load_networks(folder)


def test_what_is_shipped_can_be_read(root):
    assert {path.name for path in shipped.SHIPPED.iterdir()} == {SEGMENTATION, *DEFORMATION.values()}
    networks = load_networks()
    for record in networks.records.values():
        assert len(record["commit"]) == 12  # nothing that was not committed
    for side, name in DEFORMATION.items():
        record = networks.records[name]
        wanted = read_deformation_config(root / "experiments" / "ddot" / "shipped.yaml", [f"training.side={side}"])
        assert record["results"]["segmentation_sha256"] == network_digest(networks.segmentation)
        kept = read_results(root / "experiments" / "ddot" / f"shipped_{side}.json")
        assert kept["config"] == wanted.as_dict()
        assert [kept[key] for key in ("commit", "command", "results")] == [
            record[key] for key in ("commit", "command", "results")
        ]
