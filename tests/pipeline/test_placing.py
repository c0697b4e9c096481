"""A network that knows scans in the place of their white matter: training, loading and reconstruction agree on it."""

import numpy as np
import pytest
import torch

from bright_head import write_bright_weights
from meshot.anatomy.templates import ENLARGEMENT, HEMISPHERES, from_mni152, fsaverage5_surface
from meshot.cli import main
from meshot.model.deformation import DeformationNetwork
from meshot.model.segmentation import SegmentationNetwork
from meshot.model.weights import read_weights, write_weights
from meshot.pipeline import reconstruction as placing
from meshot.pipeline.correspondence import CarriedTemplate
from meshot.pipeline.reconstruction import SEGMENTATION, carried_in_place, load_networks, placed_white_matter
from meshot.pipeline.training_files import placement_of
from meshot.synth.recipe import read_recipe, recipe_text
from meshot.volume.registration import place_on_grid
from phantoms import write_phantom_cohort
from refusals import refuses

BY_GREY, BY_WHITE = "grey values", "white matter"


def too_small(brain):
    """As a registration of grey values places a head with its skull."""
    return place_on_grid(brain, np.diag([0.85, 0.85, 0.85, 1.0]), np.zeros(3))


def test_white_matter_is_found_again_where_it_belongs(brain, looks):
    first = too_small(brain)
    placed, found, warnings = placed_white_matter(brain, first, SegmentationNetwork(2, 1), BY_WHITE)
    assert warnings == []
    assert [each.affine.tolist() for each in looks] == [each.volume.affine.tolist() for each in (first, placed)]
    scales = np.linalg.svd(placed.to_standard[:3, :3], compute_uv=False)
    np.testing.assert_allclose(scales, ENLARGEMENT, rtol=0.02)
    data = [each.data for each in looks]
    volumes = [float((each > 0.5 * np.median(each[each > 0.3])).sum()) for each in data]
    assert volumes[1] / volumes[0] == pytest.approx((ENLARGEMENT / 0.85) ** 3, rel=0.05)
    assert found["left"].data.sum() + found["right"].data.sum() == volumes[1]
    assert np.array_equal(found["left"].affine, placed.volume.affine)
    # In a mirror, too: the mean of what is found.
    looks.clear()
    _, averaged, _ = placed_white_matter(brain, first, SegmentationNetwork(2, 1), BY_WHITE, both_ways=True)
    assert [len(looks), len(warnings)] == [3, 0]
    np.testing.assert_array_equal(looks[2].data, looks[1].data[::-1])
    # This segmentation is the same in a mirror.
    for side in HEMISPHERES:
        np.testing.assert_array_equal(averaged[side].data, found[side].data)


def test_other_networks_get_the_first_placement(brain, looks):
    first = too_small(brain)
    placed, found, warnings = placed_white_matter(brain, first, SegmentationNetwork(2, 1), BY_GREY)
    assert placed is first
    assert (len(looks), warnings) == (1, [])
    assert set(found) == set(HEMISPHERES)


def test_white_matter_that_places_no_scan_is_a_warning(brain, looks):
    data = np.zeros_like(brain.data)
    data[20:70, 40:90, 40:48] = 1.0
    scan = brain.with_data(data)
    first = place_on_grid(scan, np.eye(4), np.zeros(3))
    placed, _, (warning,) = placed_white_matter(scan, first, SegmentationNetwork(2, 1), BY_WHITE)
    assert placed is first
    assert "the white matter does not place the scan" in warning.text
    assert warning.name == "placement"


@pytest.mark.parametrize("placement", [BY_GREY, BY_WHITE])
def test_the_template_is_carried_in_mni152(monkeypatch, placement):
    template = fsaverage5_surface("white", "left", "MNI152")
    seen = []

    def carry(mesh, side):
        seen.append((mesh, side))
        return CarriedTemplate(mesh, 0.1, 0, 0)

    monkeypatch.setattr(placing, "carry_template", carry)
    surface = from_mni152(template) if placement == BY_WHITE else template
    found = carried_in_place(surface, "left", placement)
    (mesh, side), *_ = seen
    assert side == "left"
    assert torch.allclose(mesh.vertices, template.vertices)
    assert torch.allclose(found.mesh.vertices, surface.vertices)


def cohort_placed_by(folder, placement, splits=("train", "validation")):
    cohort = write_phantom_cohort(folder, list(splits))
    (cohort / "recipe.yaml").write_text(recipe_text(read_recipe("tiny", standard=placement)), encoding="utf-8")
    return cohort


def test_cohorts_must_agree(tmp_path):
    white, grey = (cohort_placed_by(tmp_path / name, name) for name in (BY_WHITE, BY_GREY))
    bare = write_phantom_cohort(tmp_path / "bare", ["train"])
    assert placement_of([white]) == BY_WHITE
    assert placement_of([grey, bare]) == BY_GREY
    refuses("bare by grey values; train on cohorts with one placement; meshot make-", placement_of, [white, bare])


def test_a_training_records_the_placement_of_its_cohorts(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    cohort_placed_by(tmp_path / "data", BY_WHITE)
    settings = "network: {width: 2, depth: 2}\ntraining: {n_epochs: 1, learning_rate: 0.01, reduction: 2}\n"
    (tmp_path / "c.yaml").write_text(settings)
    assert main(["train-segmentation", "c.yaml", "--data", "data", "-o", "out", "--threads", "1"]) == 0
    network, record = read_weights(tmp_path / "out" / SEGMENTATION, SegmentationNetwork)
    assert network.placement == record["network"]["placement"] == BY_WHITE


def test_a_flow_is_not_trained_from_surfaces_of_a_network_that_cannot_place_its_scans(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    cohort_placed_by(tmp_path / "data", BY_WHITE)
    write_weights(tmp_path / SEGMENTATION, SegmentationNetwork(2, 1), {})
    words = ["train", "ddot", "tiny", "--data", "data", "-o", "out", "--segmentation", SEGMENTATION, "--threads", "1"]
    assert main(words) == 2
    assert "data needs scans that are placed by white matter, and the segmentation" in capsys.readouterr().err


def placed_parts(folder, placements):
    """Weights of a system whose parts say how their scans were placed."""
    write_bright_weights(folder)
    for name, placement in placements.items():
        file = folder / f"{name}.safetensors"
        network, record = read_weights(file, DeformationNetwork)
        write_weights(file, network, record | {"results": record.get("results", {}) | {"placement": placement}})
    return folder


def test_a_system_asks_for_its_placement(tmp_path):
    folder = placed_parts(tmp_path / "weights", {"left_white": BY_WHITE, "right_white": BY_WHITE})
    with pytest.raises(ValueError, match="ddot needs scans that are placed by white matter, and the segmentation"):
        load_networks("ddot", folder, folder / SEGMENTATION)
    network, record = read_weights(folder / SEGMENTATION, SegmentationNetwork)
    network.placement = BY_WHITE
    write_weights(folder / SEGMENTATION, network, record)
    assert load_networks("ddot", folder, folder / SEGMENTATION).system.placement == BY_WHITE


def test_a_network_of_white_matter_serves_systems_of_grey_values(tmp_path):
    folder = write_bright_weights(tmp_path / "weights")
    network, record = read_weights(folder / SEGMENTATION, SegmentationNetwork)
    network.placement = BY_WHITE
    write_weights(folder / SEGMENTATION, network, record)
    assert load_networks("ddot", folder, folder / SEGMENTATION).system.placement == BY_GREY


def test_parts_of_two_placements_do_not_go_together(tmp_path):
    folder = placed_parts(tmp_path / "weights", {"left_white": BY_WHITE})
    with pytest.raises(
        ValueError, match="placed differently for the parts of ddot: left_white by white matter, right_"
    ):
        load_networks("ddot", folder, folder / SEGMENTATION)
