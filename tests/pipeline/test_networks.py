"""Where the trained networks of a reconstruction come from."""

import shutil

import pytest

from bright_head import write_bright_weights
from meshot.model.deformation import DeformationNetwork
from meshot.model.segmentation import SegmentationNetwork
from meshot.model.weights import network_digest, read_weights, write_weights
from meshot.pipeline import reconstruction as networks
from meshot.pipeline.reconstruction import SEGMENTATION, load_networks, segmentation_weights
from meshot.provenance import read_results
from meshot.systems import default_system, get_system, protocol as shipped, read_settings, system_names
from refusals import refuses

PARTS = ["left_white", "right_white"]


@pytest.fixture
def folder(tmp_path):
    return write_bright_weights(tmp_path / "weights")


def load(folder, system="ddot"):
    return load_networks(system, folder, folder / SEGMENTATION)


def test_networks_come_with_their_records(folder):
    found = load(folder)
    assert (found.system.name, list(found.system.parts)) == ("ddot", PARTS)
    assert found.segmentation.config() == {"width": 1, "depth": 1, "fold": 1}
    assert set(found.records) == {SEGMENTATION, *(f"{part}.safetensors" for part in PARTS)}
    assert found.records[SEGMENTATION]["command"] == "made by hand"


def test_without_a_system_its_files_are_not_needed(folder):
    for name in PARTS:
        (folder / f"{name}.safetensors").unlink()
    assert load_networks(segmentation=folder / SEGMENTATION, initial_only=True).system is None
    refuses(r"left_white.safetensors is missing; ddot needs left_white, right_white: ", load, folder)


def test_the_shipped_ones_are_used_if_no_folder_is_named(folder, monkeypatch):
    for module in (networks, shipped):
        monkeypatch.setattr(module, "SHIPPED", folder)
    (folder / "manifest.json").write_text('{"default_system": "cortexode"}')
    refuses(r"no weights of cortexode come with .* \(meshot train cortexode CONFIG .*-o", load_networks)
    (folder / "cortexode").mkdir()
    for name in PARTS:
        shutil.move(folder / f"{name}.safetensors", folder / "cortexode")
    assert load_networks().records[SEGMENTATION]["command"] == "made by hand"
    assert load_networks().system.name == "cortexode"
    (folder / SEGMENTATION).unlink()
    refuses("this installation came without them", segmentation_weights)
    refuses(r"segmentation\.safetensors does not exist; name their file", segmentation_weights, folder / SEGMENTATION)


def test_sides_are_not_taken_for_a_segmentation(folder):
    shutil.copy(folder / "left_white.safetensors", folder / SEGMENTATION)
    refuses("does not hold the weights of a SegmentationNetwork", load, folder)


def with_record(folder, part, record):
    path = folder / f"{part}.safetensors"
    write_weights(path, read_weights(path, DeformationNetwork)[0], record)


def test_the_flow_of_the_other_side_is_refused(folder):
    get_system("ddot").load(folder).save(folder / "saved")
    load_networks("ddot", folder / "saved", folder / SEGMENTATION)
    with pytest.raises(ValueError, match="holds weights of the system ddot; cortexode was asked for: take --system dd"):
        load_networks("cortexode", folder / "saved", folder / SEGMENTATION)
    shutil.copy(folder / "saved" / "left_white.safetensors", folder / "saved" / "right_white.safetensors")
    with pytest.raises(ValueError, match=r"right_white.* holds left_white of ddot; right_white is needed: rename it"):
        load_networks("ddot", folder / "saved", folder / SEGMENTATION)


def test_a_flow_from_other_initial_surfaces_is_refused(folder):
    segmentation = read_weights(folder / SEGMENTATION, SegmentationNetwork)[0]
    with_record(folder, "left_white", {"results": {"segmentation_sha256": network_digest(segmentation)}})
    load(folder)
    with_record(folder, "left_white", {"results": {"segmentation_sha256": "0" * 64}})
    refuses(r"left_white.* learned from initial surfaces of another network than", load, folder)


@pytest.mark.parametrize("group", ["training", "results"])
@pytest.mark.parametrize("content", [None, 3, "left", ["side"]])
def test_a_record_whose_groups_are_none_is_refused(folder, group, content):
    with_record(folder, "left_white", {group: content})
    refuses(r"holds .*; groups of settings are|as its results; names", load, folder)


def test_what_is_shipped_can_be_read(root):
    assert default_system() in system_names()
    found = load_networks()
    assert found.system.name == default_system()
    for record in found.records.values():
        assert len(record["commit"]) == 12  # nothing that was not committed
    for part, each in found.system.parts.items():
        side, surface = part.split("_")
        experiment, config = {"white": ("people", "shipped"), "pial": ("thickness", "pial")}[surface]
        kind, kept = type(found.system), read_results(root / "experiments" / experiment / f"{part}.json")
        assert each.record["results"]["segmentation_sha256"] == network_digest(found.segmentation)
        settings = read_settings(kind, config, [f"training.side={side}"])
        assert kind.complete(kept["config"]) == settings
        recorded = kind.complete({key: each.record[key] for key in settings.kinds()})
        assert (recorded.loss, recorded.training) == (settings.loss, settings.training)
        # The file names the extent, too.
        assert recorded.network.as_dict().items() >= settings.network.as_dict().items()
        assert [kept[key] for key in ("commit", "command", "results")] == [
            each.record[key] for key in ("commit", "command", "results")
        ]
    assert set(found.system.parts) == {f"{side}_{kind}" for side in ("left", "right") for kind in ("white", "pial")}
    white = load_networks(white_only=True)
    assert set(white.system.parts) == {"left_white", "right_white"}
    assert set(white.records) == {"segmentation.safetensors", "left_white.safetensors", "right_white.safetensors"}
