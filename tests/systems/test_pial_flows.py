"""Flows from white to pial surfaces: they learn from white surfaces that were found, and go with their flows only."""

import dataclasses

import pytest
import torch

from bright_head import shifting_network
from meshot.anatomy import HEMISPHERES
from meshot.metrics.distances import vertex_distances
from meshot.model import network_digest
from meshot.systems import ExampleSets, Part, get_system
from meshot.systems.flows import WHITE, hemisphere_example
from phantoms import phantom_subjects
from refusals import refuses

KIND = get_system("windows")
SHIFTS = {
    "left_white": (0.0, 0.0, 1.0),
    "right_white": (0.5, 0.0, 0.0),
    "left_pial": (0.0, 0.7, 0.0),
    "right_pial": (0.0, 0.0, -0.3),
}
TINY = {
    "network": {"width": 6, "hidden": [8], "n_scales": 2, "size": 3, "extent": 10.0},
    "loss": {"loss": "chamfer", "encoding": "samples"},
    "training": {
        "n_epochs": 8,
        "learning_rate": 0.02,
        "n_flow_steps": 2,
        "n_points": 500,
        "surface": "pial",
        "side": "left",
    },
}


def parts(*names, **results):
    return {
        name: Part(shifting_network(SHIFTS[name]), {"results": results} if "pial" in name else {}) for name in names
    }


@pytest.fixture(scope="module")
def one():
    torch.set_num_threads(1)
    (found,) = phantom_subjects(1, KIND.needs, pial=True)
    return found


def test_the_pial_surface_is_the_white_one_moved_on(one):
    system = KIND(parts(*SHIFTS))
    assert system.surfaces == tuple((side, kind) for side in HEMISPHERES for kind in ("white", "pial"))
    found = system.reconstruct(one.scan)
    for side in HEMISPHERES:
        ways = [found[side, "white"].vertices - one.scan.initial[side, "white"].vertices]
        ways.append(found[side, "pial"].vertices - found[side, "white"].vertices)
        for way, kind in zip(ways, ("white", "pial"), strict=True):
            torch.testing.assert_close(way, torch.tensor(SHIFTS[f"{side}_{kind}"]).expand_as(way), atol=1e-4, rtol=0)
        assert torch.equal(found[side, "pial"].faces, found[side, "white"].faces)


def test_without_pial_flows_there_are_white_surfaces_only(one):
    system = KIND(parts("left_white", "right_white"))
    assert set(system.reconstruct(one.scan)) == {("left", "white"), ("right", "white")}
    half = KIND(parts("left_white", "right_white", "left_pial"))
    refuses("windows has no trained right_pial, only left_white", half.reconstruct, one.scan)


def test_an_example_begins_at_the_white_surface_that_was_found(one):
    white = KIND(parts("left_white", "right_white"))
    found = hemisphere_example(one, "left", 400, white)
    start = one.scan.initial["left", "white"].vertices + torch.tensor(SHIFTS["left_white"])
    torch.testing.assert_close(found.initial.vertices.double(), start.double(), atol=1e-4, rtol=0)
    torch.testing.assert_close(found.target.vertices.double(), one.targets["left", "pial"].vertices.double())
    assert len(found.coarse.faces) <= 400 < len(found.initial.faces)


@pytest.fixture
def trained(tmp_path):
    """White flows in a folder, and the left flow that was trained after them."""
    torch.set_num_threads(1)
    white = KIND(parts("left_white", "right_white"))
    white.save(tmp_path / "white")
    sets = ExampleSets(phantom_subjects(3, KIND.needs, pial=True), phantom_subjects(1, KIND.needs, 50, pial=True))
    settings = TINY | {"training": TINY["training"] | {"white": str(tmp_path / "white")}}
    return white, KIND.train(sets, settings), sets


def test_a_training_brings_the_white_surface_nearer_to_the_pial_one(trained):
    white, found, sets = trained
    assert set(found.parts) == {"left_pial"}
    record = found.parts["left_pial"].record
    assert record["results"][WHITE] == network_digest(white.parts["left_white"].network)
    assert record["training"]["surface"] == "pial"
    whole = KIND(white.parts | found.parts | {"right_pial": found.parts["left_pial"]} | parts("right_pial"))
    (unseen,) = sets.validation
    made = whole.reconstruct(unseen.scan)
    truth = unseen.targets["left", "pial"]
    before, after = (vertex_distances(made["left", kind], truth).mean() for kind in ("white", "pial"))
    assert after < 0.8 * before


def test_the_flows_are_written_and_read_with_the_white_ones(trained, tmp_path):
    _, found, _ = trained
    right = dataclasses.replace(found.parts["left_pial"], network=shifting_network(SHIFTS["right_pial"]))
    right.record["results"].pop(WHITE)
    KIND({"left_pial": found.parts["left_pial"], "right_pial": right}).save(tmp_path / "white")
    again = KIND.load(tmp_path / "white")
    assert set(again.parts) == set(SHIFTS)
    (tmp_path / "white" / "right_pial.safetensors").unlink()
    assert set(KIND.load(tmp_path / "white").parts) == {"left_white", "right_white"}


def test_flows_of_other_white_surfaces_are_refused(trained):
    _, found, _ = trained
    refuses(
        "left_pial of windows learned from white surfaces of another flow", KIND,
        parts("right_white") | {"left_white": Part(shifting_network((0.0, 0.0, 2.0)))} | found.parts,
    )  # fmt: skip
    placed = parts("left_pial", placement="white matter")
    refuses("placed by grey values for the white surfaces", KIND, parts("left_white", "right_white") | placed)


def test_examples_need_pial_surfaces(one):
    bare = dataclasses.replace(one, targets={key: mesh for key, mesh in one.targets.items() if key[1] == "white"})
    refuses("has no true surface left pial, right pial", KIND.train, ExampleSets([bare], [bare]), TINY)
