"""Flows from white to pial surfaces: they learn from white surfaces that were found, and go with their flows only."""

import dataclasses
import math

import numpy as np
import pytest
import scipy.special
import torch

from bright_head import shifting_network
from meshot.anatomy import HEMISPHERES
from meshot.mesh import Mesh, icosphere
from meshot.metrics import Surface
from meshot.metrics.distances import vertex_distances
from meshot.model import network_digest
from meshot.systems import ExampleSets, Part, get_system
from meshot.systems.flows import WHITE, deformed, digest, hemisphere_example, matched_places, matching_loss
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
    with_both = KIND(parts(*SHIFTS)).with_white_only()
    assert (with_both.surfaces, set(with_both.parts)) == (system.surfaces, set(system.parts))
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


def test_vertices_belong_where_the_nearest_point_of_the_true_surface_does():
    white = icosphere(4, 10.0)
    stretch = torch.tensor([1.2, 1.3, 1.4], dtype=torch.float64)
    pial = white.with_vertices(white.vertices * stretch)
    found = white.with_vertices(white.vertices * 1.05)
    places = matched_places(found, white, pial)
    torch.testing.assert_close(places.double(), pial.vertices, atol=0.01, rtol=0)
    assert not places.isnan().any()
    far = white.with_vertices(white.vertices * 1.11)
    assert matched_places(far, white, pial).isnan().all()
    inside_out = Mesh(found.vertices, found.faces.flip(1))
    assert matched_places(inside_out, white, pial).isnan().all()


def test_places_within_a_face_are_carried_linearly():
    source = Mesh(torch.tensor([[0.0, 0, 0], [4, 0, 0], [0, 4, 0]]), torch.tensor([[0, 1, 2]]))
    target = source.with_vertices(torch.tensor([[0.0, 0, 1], [8, 0, 1], [0, 4, 9]]))
    found = Surface(source).carry(np.array([[1.0, 1.0, 0.3], [-1.0, 2.0, 0.0]]), target)
    np.testing.assert_allclose(found, [[2.0, 1.0, 3.0], [0.0, 2.0, 5.0]], atol=1e-12)


def test_the_matching_loss_is_hubers():
    ways = torch.tensor([[0.3, 0.4, 0.0], [0.0, 0.0, 2.0], [1.0, 1.0, 1.0]], dtype=torch.float64)
    places = torch.tensor([[0.0, 0, 0], [0, 0, 0], [math.nan, 0, 0]], dtype=torch.float64)
    expected = scipy.special.huber(1.0, [0.5, 2.0]).mean()
    assert float(matching_loss(ways, places)) == pytest.approx(expected, rel=1e-12)
    assert torch.autograd.gradcheck(lambda x: matching_loss(x, places), ways.requires_grad_())
    assert float(matching_loss(ways.detach(), torch.full_like(places, math.nan))) == 0


def test_matching_brings_vertices_to_their_places(trained, tmp_path):
    """With matching, the moved vertices come nearer to their own places than without it."""
    white, without, sets = trained
    settings = TINY | {"training": TINY["training"] | {"white": str(tmp_path / "white"), "matching": 3.0}}
    found = KIND.train(sets, settings)
    distances = []
    for each in (without, found):
        item = hemisphere_example(sets.validation[0], "left", 400, white)
        moved = deformed(item.coarse, item.scan, each.parts["left_pial"].network, 2, standard=item.initial)
        distances.append(float(matching_loss(moved.vertices, item.places)))
    assert distances[1] < 0.9 * distances[0]


def test_places_are_part_of_the_data_of_a_training(one):
    item = hemisphere_example(one, "left", 400, KIND(parts("left_white", "right_white")))
    assert not item.places.isnan().all()
    assert digest([item]) != digest([dataclasses.replace(item, places=item.places + 1)])


def test_matching_needs_pial_surfaces_that_correspond(trained, tmp_path):
    _, _, sets = trained
    refuses("training.surface is 'white'", KIND.complete, {"training": {"matching": 1.0}})
    other = [
        dataclasses.replace(each, targets=each.targets | {("left", "pial"): icosphere(3, 20.0)})
        for each in sets.training
    ]
    settings = TINY | {"training": TINY["training"] | {"white": str(tmp_path / "white"), "matching": 1.0}}
    refuses("different faces", KIND.train, ExampleSets(other, sets.validation), settings)
    plain = TINY | {"training": TINY["training"] | {"white": str(tmp_path / "white"), "n_epochs": 1}}
    KIND.train(ExampleSets(other, sets.validation), plain)


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
