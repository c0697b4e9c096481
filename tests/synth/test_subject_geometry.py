"""Offsets, refinement, separation and random fields, on balls and planes."""

import math

import numpy as np
import pytest
import torch

import meshot.synth.subject
from meshot.flow.crossings import sampled_lipschitz
from meshot.mesh import united
from meshot.mesh.connectivity import SPHERE, topology
from meshot.mesh.geometry import signed_volume
from meshot.mesh.mesh import Mesh
from meshot.mesh.shapes import icosphere
from meshot.synth.subject import (
    crossing_faces,
    kept_apart,
    loop_subdivided,
    offset_surface,
    on_lattice,
    random_velocity,
    random_warp,
    smooth_variation,
    smoothly_refined,
)
from refusals import refuses


@pytest.mark.parametrize("distance", [2.5, -2.0])
def test_a_ball_offset_is_a_larger_or_smaller_ball(distance):
    ball = icosphere(4, radius=20.0)
    moved = offset_surface(ball, torch.full_like(ball.vertices[:, 0], distance))
    radii = moved.vertices.norm(dim=1)
    assert float((radii - 20 - distance).abs().max()) < 0.05
    assert offset_surface(ball, torch.zeros(len(ball.vertices), dtype=torch.float64)) is ball


def test_banks_that_face_each_other_do_not_pass():
    # Two balls 3 mm apart, each asked to grow by 3 mm: the room between them holds half of it.
    balls = [icosphere(4, 15.0, centre=(x, 0.0, 0.0)) for x in (-16.5, 16.5)]
    both = united(balls)
    moved = offset_surface(both, torch.full_like(both.vertices[:, 0], 3.0))
    left, right = moved.vertices.split(len(balls[0].vertices))
    assert float(left[:, 0].max()) < 0 < float(right[:, 0].min())
    assert float(left[:, 0].max()) > -1.0
    assert float((left[:, 0].min() + 16.5).abs()) == pytest.approx(18, abs=0.05)


def test_distances_of_two_signs_or_another_number_are_refused():
    ball = icosphere(2, radius=10.0)
    wrong = torch.ones(len(ball.vertices), dtype=torch.float64)
    wrong[0] = -1
    for distances in (wrong, wrong[1:]):
        refuses("one for each, all of one sign", offset_surface, ball, distances)


def test_a_pocket_inside_out_counts_as_outside():
    ball, pocket = icosphere(4, 20.0), icosphere(2, 2.0, centre=(35.0, 0.0, 0.0))
    both = united([ball, Mesh(pocket.vertices, pocket.faces.flip(1))])
    moved = offset_surface(both, torch.full_like(both.vertices[:, 0], -2.0)).vertices[: len(ball.vertices)]
    assert float((moved.norm(dim=1) - 18).abs().max()) < 0.05
    with pytest.raises(ValueError, match="normals point inward"):
        offset_surface(Mesh(ball.vertices, ball.faces.flip(1)), torch.ones(len(ball.vertices), dtype=torch.float64))


def test_refinement_leaves_a_ball_round_and_old_vertices_where_they_were():
    coarse = icosphere(3, radius=50.0)
    fine, shrunk = smoothly_refined(coarse), loop_subdivided(coarse)
    assert topology(fine) == SPHERE
    assert len(fine.faces) == 4 * len(coarse.faces)
    radii = fine.vertices.norm(dim=1)
    # Midpoints would lie .3 mm within the sphere.
    assert float((radii - 50).abs().max()) < 0.1
    assert float(shrunk.vertices.norm(dim=1).max()) < 49.9
    assert float((fine.vertices[:642] - coarse.vertices).norm(dim=1).max()) < 0.03
    twice = smoothly_refined(coarse, 2)
    assert len(twice.vertices) == 10_242


def test_loop_keeps_planes_and_centres():
    ball = icosphere(2)
    flat = ball.with_vertices(ball.vertices * torch.tensor([1.0, 1.0, 0.0], dtype=torch.float64))
    assert float(loop_subdivided(flat).vertices[:, 2].abs().max()) == 0
    assert torch.allclose(loop_subdivided(ball).vertices.mean(dim=0), torch.zeros(3, dtype=torch.float64), atol=1e-12)


def test_two_balls_that_overlap_are_smoothed_apart():
    inner, outer = icosphere(3, radius=10.0), icosphere(3, radius=10.5)
    dented = outer.vertices.clone()
    dented[0] *= 0.9  # one vertex of the outer ball lies within the inner one
    meshes = [inner, outer.with_vertices(dented)]
    assert len(crossing_faces(meshes))
    apart = kept_apart(meshes)
    assert not len(crossing_faces(apart))
    moved = (apart[1].vertices - meshes[1].vertices).norm(dim=1)
    assert int((moved > 1e-3).sum()) < 60
    assert float(signed_volume(apart[1])) > float(signed_volume(apart[0]))


def test_what_cannot_be_kept_apart_is_said(unchecked, monkeypatch):
    monkeypatch.setattr(meshot.synth.subject, "_CROSSING_SMOOTHINGS", 2)
    ball = icosphere(3, radius=10.0)
    shifted = ball.with_vertices(ball.vertices + torch.tensor([10.0, 0, 0], dtype=torch.float64))
    assert kept_apart([ball, shifted]) is None
    monkeypatch.setattr(meshot.synth.subject, "_ROUNDS", 0)
    assert kept_apart([ball]) is None
    refuses("meshes is empty", kept_apart, [])


def test_meshes_are_united_in_order():
    meshes = [icosphere(0), icosphere(1), icosphere(0)]
    both = united(meshes)
    assert len(both.vertices) == 12 + 42 + 12
    assert torch.equal(both.faces[-20:], meshes[2].faces + 54)
    points = torch.tensor([[0.1, -70.123456789, 1e-5]], dtype=torch.float64)
    assert float((on_lattice(points) - points).abs().max()) <= 2.0**-14
    assert float(signed_volume(both)) == pytest.approx(sum(float(signed_volume(m)) for m in meshes))


def test_velocities_have_the_size_asked_for():
    rng = np.random.default_rng(0)
    points = torch.from_numpy(rng.uniform(-200, 200, (4000, 3)))
    for warp in ((3.0,), (0.0, 2.0), (3.0, 2.0, 1.2)):
        field = random_velocity(points, warp_mm=warp, generator=1)
        speed = field(torch.tensor(0.5, dtype=torch.float64), points).std(dim=0)
        assert speed.numpy() == pytest.approx(math.hypot(*warp), rel=0.15)


def test_a_warp_is_repeatable_smooth_and_keeps_a_ball_from_crossing():
    ball = icosphere(4, radius=40.0)
    warp = (3.0, 2.0, 1.0)
    one, two = random_warp([ball, ball], 0.0, warp, 3).of_meshes([ball, ball])
    assert torch.equal(one.vertices, two.vertices)
    assert torch.equal(one.vertices, random_warp([ball], 0.0, warp, 3).of_meshes([ball])[0].vertices)
    assert not torch.equal(one.vertices, random_warp([ball], 0.0, warp, 4).of_meshes([ball])[0].vertices)
    assert not len(crossing_faces([one]))
    assert 1 < float((one.vertices - ball.vertices).norm(dim=1).mean()) < 12
    field = random_velocity(ball.vertices, warp_mm=warp, generator=3)
    assert float(sampled_lipschitz(field, ball.vertices)) < float(field.lipschitz_bound())


def test_a_warp_can_be_undone():
    ball = icosphere(3, radius=40.0)
    for warp_mm in ((), (3.0, 2.0, 1.0)):
        warp = random_warp([ball], 0.1, warp_mm, 5)
        there = warp.forward(ball.vertices)
        assert float((there - ball.vertices).norm(dim=1).mean()) > 1
        assert float((warp.backward(there) - ball.vertices).norm(dim=1).max()) < 1e-3


def test_impossible_warps_are_refused():
    ball = icosphere(2, radius=30.0)
    for warp in ((-1.0,), (math.nan,)):
        refuses("one number >= 0 for each scale", random_warp, [ball], 0.0, warp, 0)
    refuses("one number >= 0 for each scale", random_velocity, ball.vertices, warp_mm=(), generator=0)
    refuses("Lipschitz bound", random_warp, [ball], 0.0, (3.0, 2.0, 30.0), 0)
    refuses("length is 0", smooth_variation, ball.vertices, 0.0, 0)
    refuses("n_fields 4", smooth_variation, ball.vertices, 10.0, 0, 4)


def test_smooth_variation_has_unit_spread_and_its_length():
    points = torch.from_numpy(np.random.default_rng(0).uniform(-150, 150, (6000, 3)))
    fields = smooth_variation(points, 20.0, 5, 2)
    assert fields.shape == (6000, 2)
    assert fields.std(dim=0).numpy() == pytest.approx(1, abs=0.1)
    assert float(fields.abs().max()) <= 2.5
    assert abs(np.corrcoef(fields.T.numpy())[0, 1]) < 0.1
    near = smooth_variation(torch.cat([points, points + 0.5]), 20.0, 5)[:, 0].view(2, -1)
    assert float((near[0] - near[1]).abs().mean()) < 0.1
