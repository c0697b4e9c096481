import math

import numpy as np
import pytest
import torch

from meshot.flow.crossings import sampled_lipschitz
from meshot.flow.fields import GridVelocity, grid_around, spline_values
from meshot.flow.integration import integrate
from refusals import refuses


def random_field(spacings=(8.0, 4.0, 2.0), n_pieces=3, size=1.0, seed=0, interpolation="cubic"):
    box = (torch.full((3,), -5.0).double(), torch.full((3,), 20.0).double())
    field = GridVelocity(*box, spacings, n_pieces, interpolation)
    generator = np.random.default_rng(seed)
    for level in field.levels:
        level.data = size * torch.from_numpy(generator.standard_normal(level.shape))
    return field


def random_points(n, seed=1):
    return torch.from_numpy(np.random.default_rng(seed).uniform(-5, 20, (n, 3)))


def test_starts_at_rest():
    points = random_points(20)
    field = grid_around(points)
    assert torch.equal(integrate(field, points), points)
    assert float(field.lipschitz_bound()) == 0


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
def test_is_the_sum_of_its_levels(interpolation):
    field, points = random_field(interpolation=interpolation), random_points(100)
    for piece, time in enumerate((0.1, 0.5, 0.9)):
        parts = [
            spline_values(level[piece], (points - field.lower) / spacing + 1, interpolation)
            for level, spacing in zip(field.levels, field.spacings, strict=True)
        ]
        torch.testing.assert_close(field(torch.tensor(time).double(), points), sum(parts))


def test_pieces_begin_where_they_should():
    field, points = random_field(n_pieces=4), random_points(5)
    at = [field(torch.tensor(t).double(), points) for t in (0.0, 0.2499, 0.25, 0.5, 1.0)]
    assert torch.equal(at[0], at[1])
    assert not torch.allclose(at[1], at[2])
    assert not torch.allclose(at[2], at[3])
    assert torch.equal(at[4], field(torch.tensor(0.76).double(), points))


def test_outside_the_box_the_nearest_point_speaks():
    field, time = random_field(), torch.tensor(0.0).double()
    outside = torch.tensor([[-9.0, 3.0, 50.0]]).double()
    torch.testing.assert_close(field(time, outside), field(time, torch.tensor([[-5.0, 3.0, 27.0]]).double()))


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
def test_lipschitz_bound_holds_and_is_not_far_off(interpolation):
    field, time = random_field(interpolation=interpolation), torch.tensor(0.0).double()
    points = random_points(4000, seed=5)
    near = points + 1e-5 * random_points(4000, seed=6)
    slopes = torch.linalg.vector_norm(field(time, points) - field(time, near), dim=1).detach()
    steepest = float((slopes / torch.linalg.vector_norm(points - near, dim=1)).max())
    bound = float(field.lipschitz_bound())
    assert steepest <= bound < 6 * steepest
    assert steepest * 0.7 < float(sampled_lipschitz(field, points)) <= bound
    assert field.is_lipschitz


def test_lipschitz_bound_of_a_linear_field():
    # Coefficients that are linear in the node make a spline that is linear in space, with the same slope.
    field = GridVelocity(torch.zeros(3).double(), torch.ones(3).double(), (1.0,), 1)
    nodes = torch.arange(4).double() - 1
    field.levels[0].data[..., 0] = 3 * nodes[:, None, None]
    point = torch.tensor([[0.25, 0.5, 0.75]]).double()
    torch.testing.assert_close(field(torch.tensor(0.0).double(), point), torch.tensor([[0.75, 0.0, 0.0]]).double())
    assert float(field.lipschitz_bound()) == pytest.approx(3)


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
def test_gradcheck_through_the_flow(interpolation):
    field, points = random_field((8.0, 4.0), 2, 0.5, interpolation=interpolation), random_points(4).requires_grad_()
    levels = list(field.levels)

    def flow(points, *_):
        return integrate(field, points, 4)

    assert torch.autograd.gradcheck(flow, (points, *levels), fast_mode=True)


@pytest.mark.parametrize(("method", "order"), [("euler", 1), ("midpoint", 2), ("rk4", 4)])
def test_order_survives_jumps_in_time(method, order):
    # Only if each step sees the piece of time it crosses, at both of its ends. C² in space allows order 3 or so; the
    # border of the box, where the field is only continuous, is out of reach.
    field, points = random_field((16.0,), 3, size=2.0), 0.3 * random_points(200) + 8
    exact = integrate(field, points, 480, "rk4").detach()
    errors = [float((integrate(field, points, n, method) - exact).detach().norm()) for n in (12, 24)]
    assert math.log2(errors[0] / errors[1]) > min(order, 3) - 0.3


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"spacings": (24.0, 10.0)}, "each half the one before"),
        ({"spacings": ()}, "each half the one before"),
        ({"spacings": (-1.0,)}, "positive"),
        ({"n_pieces": 0}, "n_pieces is 0"),
        ({"interpolation": "quintic"}, "one of linear, cubic"),
        ({"margin": -1.0}, "margin is -1.0"),
        ({"margin": math.nan}, "margin is nan"),
    ],
)
def test_doors(arguments, words):
    with pytest.raises(ValueError, match=words):
        grid_around(random_points(3), **arguments)


def test_empty_box():
    refuses("is empty; lower must be below upper", GridVelocity, torch.zeros(3), torch.tensor([1.0, 0.0, 1.0]))
