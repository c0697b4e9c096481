"""Random fields: their size, their smoothness, that a seed repeats them."""

import math

import numpy as np
import pytest
import torch

from meshot.flow.crossings import sampled_lipschitz
from meshot.mesh.shapes import icosphere
from meshot.synth.subject import crossing_faces, random_velocity, random_warp, smooth_variation


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
        with pytest.raises(ValueError, match="one number >= 0 for each scale"):
            random_warp([ball], 0.0, warp, 0)
    with pytest.raises(ValueError, match="one number >= 0 for each scale"):
        random_velocity(ball.vertices, warp_mm=(), generator=0)
    with pytest.raises(ValueError, match="Lipschitz bound"):
        random_warp([ball], 0.0, (3.0, 2.0, 30.0), 0)
    with pytest.raises(ValueError, match="length is 0"):
        smooth_variation(ball.vertices, 0.0, 0)
    with pytest.raises(ValueError, match="n_fields 4"):
        smooth_variation(ball.vertices, 10.0, 0, 4)


def test_smooth_variation_has_unit_spread_and_its_length():
    points = torch.from_numpy(np.random.default_rng(0).uniform(-150, 150, (6000, 3)))
    fields = smooth_variation(points, 20.0, 5, 2)
    assert fields.shape == (6000, 2)
    assert fields.std(dim=0).numpy() == pytest.approx(1, abs=0.1)
    assert float(fields.abs().max()) <= 2.5
    assert abs(np.corrcoef(fields.T.numpy())[0, 1]) < 0.1
    near = smooth_variation(torch.cat([points, points + 0.5]), 20.0, 5)[:, 0].view(2, -1)
    assert float((near[0] - near[1]).abs().mean()) < 0.1
