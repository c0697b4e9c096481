"""Smooth refinement, on balls and planes."""

import torch

from meshot.mesh.connectivity import SPHERE, topology
from meshot.mesh.shapes import icosphere
from meshot.synth.subject import loop_subdivided, smoothly_refined


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
