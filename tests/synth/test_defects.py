"""Each planted error is of its kind and size, and of no other kind."""

import math

import numpy as np
import pytest
import torch

from meshot.mesh.connectivity import SPHERE, boundary_edges, euler_number, self_intersecting_faces, topology
from meshot.mesh.geometry import edge_lengths, face_areas, face_normals, mesh_edges, signed_volume
from meshot.mesh.mesh import Mesh
from meshot.mesh.shapes import folded_sphere, icosphere
from meshot.metrics.distances import vertex_distances
from meshot_book.defects import (
    facing_walls,
    inflated,
    noisy,
    shifted,
    unevenly_sampled,
    with_blurred_folds,
    with_bridge,
    with_crossing,
    with_flipped_faces,
    with_hole,
    with_spike,
)
from refusals import refuses

SPHERE_MESH = icosphere(3, 10.0)
TOP = torch.tensor([0.0, 0.0, 10.0], dtype=torch.float64)


@pytest.fixture(scope="module")
def folded():
    """Deep narrow folds: banks that face each other."""
    return folded_sphere(4, 40.0, 12.0, 10)


def test_a_shift_moves_all_alike():
    moved = shifted(SPHERE_MESH, (3.0, 0.0, -4.0))
    apart = moved.vertices - SPHERE_MESH.vertices
    torch.testing.assert_close(apart, torch.tensor([3.0, 0, -4]).double().expand(642, 3))
    assert moved.faces is SPHERE_MESH.faces


def test_an_inflated_sphere_is_a_larger_one():
    torch.testing.assert_close(
        inflated(SPHERE_MESH, 0.5).vertices.norm(dim=1), torch.full((642,), 10.5).double(), atol=1e-4, rtol=0
    )
    torch.testing.assert_close(inflated(SPHERE_MESH, -0.5).vertices, SPHERE_MESH.vertices * 0.95, atol=0.01, rtol=0)


def test_noise_has_its_deviation_and_its_seed():
    amounts = noisy(SPHERE_MESH, 0.2, 0).vertices.norm(dim=1) - 10
    assert float(amounts.std()) == pytest.approx(0.2, rel=0.08)
    assert abs(float(amounts.mean())) < 4 * 0.2 / math.sqrt(642)
    assert torch.equal(noisy(SPHERE_MESH, 0.2, 0).vertices, noisy(SPHERE_MESH, 0.2, 0).vertices)
    assert not torch.equal(noisy(SPHERE_MESH, 0.2, 0).vertices, noisy(SPHERE_MESH, 0.2, 1).vertices)


def test_a_hole_is_a_disc_that_is_gone():
    found = with_hole(SPHERE_MESH, TOP, 4.0)
    # A ball of radius r around a point of a sphere cuts off a cap of area πr².
    gone = float(face_areas(SPHERE_MESH).sum() - face_areas(found).sum())
    assert gone == pytest.approx(math.pi * 16, rel=0.1)
    assert euler_number(found) == 1
    assert len(boundary_edges(found)) > 10
    assert len(found.vertices) == len(found.faces.unique())


def test_a_spike_is_one_vertex():
    found = with_spike(SPHERE_MESH, 7, 3.0)
    moves = (found.vertices - SPHERE_MESH.vertices).norm(dim=1)
    assert float(moves[7]) == pytest.approx(3.0)
    assert float(moves.sum()) == pytest.approx(3.0)
    assert float(found.vertices[7].norm()) == pytest.approx(13.0)


def test_folds_are_blurred_within_the_ball_only(folded):
    centre = folded.vertices[100]
    found = with_blurred_folds(folded, centre, 15.0, 30)
    moves = (found.vertices - folded.vertices).norm(dim=1)
    outside = (folded.vertices - centre).norm(dim=1) > 15
    assert float(moves[outside].max()) == 0
    assert float(moves.max()) > 1
    assert topology(found) == SPHERE


def test_uneven_sampling_changes_no_point_of_the_surface():
    upper = SPHERE_MESH.vertices[SPHERE_MESH.faces].mean(dim=1)[:, 2] > 0
    found = unevenly_sampled(SPHERE_MESH, upper, 2)
    assert len(found.faces) == int((~upper).sum()) + 9 * int(upper.sum())
    assert topology(found) == SPHERE
    assert float(signed_volume(found)) == pytest.approx(float(signed_volume(SPHERE_MESH)), rel=1e-12)
    assert float(face_areas(found).sum()) == pytest.approx(float(face_areas(SPHERE_MESH).sum()), rel=1e-12)
    assert vertex_distances(found, SPHERE_MESH).max() < 1e-12
    assert vertex_distances(SPHERE_MESH, found).max() < 1e-12


def test_flipped_faces_are_counted_and_stay():
    found = with_flipped_faces(SPHERE_MESH, 0.1, 0)
    cosines = (face_normals(found) * face_normals(SPHERE_MESH)).sum(dim=1)
    assert int((cosines < 0).sum()) == 128
    np.testing.assert_allclose(cosines.abs(), 1)
    inside_out = with_flipped_faces(SPHERE_MESH, 1.0, 0)
    assert float(signed_volume(inside_out)) == pytest.approx(-float(signed_volume(SPHERE_MESH)))


def test_banks_face_each_other(folded):
    banks = facing_walls(folded, 2.0, 8.0)
    assert float(banks.gaps.min()) >= 2
    assert float(banks.gaps.max()) <= 8
    assert bool((banks.gaps.diff() <= 0).all())
    middles, normals = folded.vertices[folded.faces].mean(dim=1), face_normals(folded)
    for one, other in banks.faces.tolist():
        across = torch.nn.functional.normalize(middles[other] - middles[one], dim=0)
        assert float(normals[one] @ across) >= 0.8
        assert float(normals[other] @ across) <= -0.8
        assert float((middles[other] - middles[one]).norm()) <= 8


def test_a_bridge_is_one_handle(folded):
    found = with_bridge(folded)
    assert topology(found) == type(SPHERE)(0, 1, 0, 0, True)
    assert len(self_intersecting_faces(found)) == 0
    assert len(found.faces) == len(folded.faces) + 4
    # The tube holds a little of what was outside: it is solid, its normals look outward.
    assert 0 < float(signed_volume(found) - signed_volume(folded)) < 100


def test_a_crossing_crosses_and_keeps_the_topology(folded):
    found = with_crossing(folded, 0.5, 2.0, 8.0)
    assert topology(found) == SPHERE
    assert len(self_intersecting_faces(folded)) == 0
    assert len(self_intersecting_faces(found)) >= 2
    assert int(((found.vertices - folded.vertices).norm(dim=1) > 0).sum()) == 3


def two_plates(turn=0):
    """Two triangles that look at each other across a gap of 3, the second listed from any of its corners."""
    sheet = torch.tensor([[0.0, 0, 0], [2, 0, 0], [0, 2, 0]]).double()
    upper = torch.tensor([3, 5, 4]).roll(turn)
    return Mesh(torch.cat([sheet, sheet + torch.tensor([0, 0, 3.0])]), torch.stack([torch.tensor([0, 1, 2]), upper]))


def test_a_bridge_between_two_plates_is_straight():
    found = with_bridge(two_plates(), 1.0, 4.0)
    assert len(found.faces) == 6
    assert float(face_areas(found).sum()) == pytest.approx(3 * (2 + 2 + 2 * math.sqrt(2)))
    assert euler_number(found) == 0


def test_nothing_changes_its_input(folded):
    vertices, faces = folded.vertices.clone(), folded.faces.clone()
    shifted(folded, (1.0, 0.0, 0.0)), noisy(folded, 0.1, 0), inflated(folded, 0.1), with_spike(folded, 3, 2.0)
    with_flipped_faces(folded, 0.5, 0), with_crossing(folded, 0.5, 2.0, 8.0), with_bridge(folded)
    assert torch.equal(folded.vertices, vertices)
    assert torch.equal(folded.faces, faces)


@pytest.mark.parametrize(
    ("plant", "words"),
    [
        (lambda m: noisy(m, 0.0, 0), "deviation is 0.0"),
        (lambda m: with_hole(m, TOP, 0.0), "radius is 0.0"),
        (lambda m: with_hole(m, TOP, 0.01), "0 of 1280 faces"),
        (lambda m: with_hole(m, TOP, 100.0), "1280 of 1280 faces"),
        (lambda m: with_spike(m, 642, 1.0), "vertex is 642"),
        (lambda m: with_blurred_folds(m, TOP, 0.0, 3), "radius is 0.0"),
        (lambda m: with_blurred_folds(m, TOP, 1.0, 0), "n_steps is 0"),
        (lambda m: unevenly_sampled(m, torch.ones(1280, dtype=torch.bool), 0), "n_rounds is 0"),
        (lambda m: unevenly_sampled(m, torch.ones(3, dtype=torch.bool), 1), "each of 1280 faces"),
        (lambda m: with_flipped_faces(m, 0.0, 0), "share is 0.0"),
        (lambda m: with_bridge(m, 3.0, 2.0), "narrowest is 3.0"),
        (with_bridge, "no two faces face each other"),
        (lambda m: with_crossing(m, 0.0), "depth is 0.0"),
    ],
)
def test_doors(unchecked, plant, words):
    refuses(words, plant, SPHERE_MESH)


def test_a_bridge_that_would_cross_is_not_built():
    plates = two_plates()
    wall = torch.tensor([[-5.0, -5, 1.5], [9, -5, 1.5], [-5, 9, 1.5]]).double()
    blocked = Mesh(torch.cat([plates.vertices, wall]), torch.cat([plates.faces, torch.tensor([[6, 7, 8]])]))
    refuses("each of 1 bridges would cross", with_bridge, blocked, 2.5, 4.0)


def test_a_crossing_goes_as_far_as_it_says(folded):
    banks = facing_walls(folded, 2.0, 8.0)
    moves = (with_crossing(folded, 0.5, 2.0, 8.0).vertices - folded.vertices).norm(dim=1)
    torch.testing.assert_close(moves[moves > 0], banks.gaps[-1].expand(3) + 0.5)


@pytest.mark.parametrize("turn", range(3))
def test_a_bridge_is_not_twisted(turn):
    """Each corner is joined to the one across: the longest edge of the tube is a diagonal of its straight sides."""
    found = with_bridge(two_plates(turn), 1.0, 4.0)
    rises = edge_lengths(found)[(found.vertices[mesh_edges(found)][:, :, 2]).diff(dim=1)[:, 0].abs() > 1]
    wanted = torch.tensor([3.0, 3, 3, 13**0.5, 13**0.5, 17**0.5], dtype=torch.float64)
    torch.testing.assert_close(rises.sort().values, wanted)
