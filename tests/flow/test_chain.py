"""Chains of flows: against the product of matrices, and against one flow cut in pieces."""

import pytest
import torch

from meshot.flow.crossings import inspect_paths
from meshot.flow.integration import integrate, trajectory
from meshot_book.flows import Affine, Leg, chain_end, chain_reports, chain_trajectory, rotation, shear

POINTS = torch.tensor([[1.0, 2.0], [-0.5, 0.3], [0.0, -1.0]], dtype=torch.float64)


def test_the_first_leg_comes_first():
    first, second = shear(0.7), rotation(0.9)
    expected = second.flow(first.flow(POINTS))
    assert float((first.flow(second.flow(POINTS)) - expected).abs().max()) > 0.1
    # One Euler step of a shear is exact; a rotation by RK4 errs by less than 1e-9 in 64 steps.
    legs = [Leg(first, 1), Leg(second, 64, "rk4")]
    torch.testing.assert_close(chain_end(legs, POINTS), expected, atol=1e-9, rtol=0)


def test_no_leg_moves_nothing():
    assert torch.equal(chain_end([], POINTS), POINTS)
    assert torch.equal(chain_trajectory([], POINTS), POINTS[None])
    assert chain_reports([], POINTS) == []


def test_the_trajectory_passes_every_step_once():
    legs = [Leg(rotation(0.5), 3), Leg(shear(1.0), 2, "midpoint"), Leg(rotation(-1.0), 4, "rk4")]
    positions = chain_trajectory(legs, POINTS)
    assert positions.shape == (1 + 3 + 2 + 4, 3, 2)
    assert torch.equal(positions[0], POINTS)
    assert torch.equal(positions[-1], chain_end(legs, POINTS))
    assert torch.equal(positions[:4], trajectory(legs[0].field, POINTS, 3))
    middle = integrate(legs[0].field, POINTS, 3)
    assert torch.equal(positions[3:6], trajectory(legs[1].field, middle, 2, "midpoint"))


def test_reports_begin_where_the_leg_before_ended():
    # What the second leg meets depends on where the first one took the points.
    matrix = torch.diag(torch.tensor([0.0, 0.4], dtype=torch.float64))
    legs = [Leg(shear(2.0), 2), Leg(Affine(matrix), 3)]
    first, second = chain_reports(legs, POINTS)
    middle = integrate(legs[0].field, POINTS, 2)
    assert torch.equal(second.positions, inspect_paths(legs[1].field, middle, 3).positions)
    assert torch.equal(second.positions[-1], chain_end(legs, POINTS))
    assert first.steepest == pytest.approx(2.0)
    assert second.steepest == pytest.approx(0.4)
    torch.testing.assert_close(second.volume_factors, torch.full((3,), (1 + 0.4 / 3) ** 3).double())


def test_gradients_go_through_all_legs():
    points = POINTS.clone().requires_grad_()
    legs = [Leg(shear(0.7), 1), Leg(shear(-0.2), 1)]
    torch.autograd.gradcheck(lambda x: chain_end(legs, x), points)
    (gradient,) = torch.autograd.grad(chain_end(legs, points)[:, 0].sum(), points)
    torch.testing.assert_close(gradient, torch.tensor([[1.0, 0.5]] * 3).double())


def test_bad_steps_are_refused(unchecked):
    with pytest.raises(ValueError, match="n_steps"):
        chain_end([Leg(shear(1.0), 0)], POINTS)
