"""Offsets of balls, whose answer is a ball, and of balls that face each other."""

import pytest
import torch

from meshot.mesh.mesh import Mesh
from meshot.mesh.shapes import icosphere
from meshot.synth.subject import offset_surface, united


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
        with pytest.raises(ValueError, match="one for each, all of one sign"):
            offset_surface(ball, distances)


def test_a_pocket_inside_out_counts_as_outside():
    ball, pocket = icosphere(4, 20.0), icosphere(2, 2.0, centre=(35.0, 0.0, 0.0))
    both = united([ball, Mesh(pocket.vertices, pocket.faces.flip(1))])
    moved = offset_surface(both, torch.full_like(both.vertices[:, 0], -2.0)).vertices[: len(ball.vertices)]
    assert float((moved.norm(dim=1) - 18).abs().max()) < 0.05
    with pytest.raises(ValueError, match="normals point inward"):
        offset_surface(Mesh(ball.vertices, ball.faces.flip(1)), torch.ones(len(ball.vertices), dtype=torch.float64))
