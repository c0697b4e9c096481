import math

import numpy as np
import pytest
import torch

from meshot.flow.fields import grid_around
from meshot.flow.integration import integrate, trajectory
from meshot_book.examples.memory import peak_saved_bytes
from meshot_book.examples.unsteady import Accelerated, Drifting
from meshot_book.flows import NetworkVelocity, Vortex, spiral
from refusals import refuses

FIELDS = {
    "spiral, faster and faster": Accelerated(spiral(1.2, 0.3), 1.0),
    "drifting vortex": Drifting(Vortex(2.0, 0.8), torch.tensor([0.7, -0.4], dtype=torch.float64)),
}
ORDERS = [("euler", 1), ("midpoint", 2), ("rk4", 4)]
POINTS = torch.from_numpy(np.random.default_rng(0).uniform(0.1, 0.9, (20, 2)))
PULL = torch.from_numpy(np.random.default_rng(1).normal(size=(20, 2)))


def logistic(time, points):
    return points * (1 - points)


def order_of(error, coarse, fine):
    return math.log2(error(coarse) / error(fine))


@pytest.mark.parametrize("name", FIELDS)
@pytest.mark.parametrize(("method", "order"), ORDERS)
@pytest.mark.parametrize("inverse", [False, True])
def test_order_of_convergence(name, method, order, inverse):
    field = FIELDS[name]
    start, exact = (POINTS, field.flow(POINTS))[:: -1 if inverse else 1]

    def error(n):
        return float((integrate(field, start, n, method, inverse) - exact).norm())

    assert order_of(error, 80, 160) == pytest.approx(order, abs=0.1)


@pytest.mark.parametrize("name", FIELDS)
@pytest.mark.parametrize(("method", "order"), ORDERS)
@pytest.mark.parametrize("gradient", ["direct", "adjoint"])
def test_order_of_the_gradient(name, method, order, gradient):
    field = FIELDS[name]

    def slope(flow):
        points = POINTS.clone().requires_grad_()
        return torch.autograd.grad((PULL * flow(points)).sum(), points)[0]

    exact = slope(field.flow)

    def error(n):
        return float((slope(lambda x: integrate(field, x, n, method, gradient=gradient)) - exact).norm())

    assert order_of(error, 80, 160) == pytest.approx(order, abs=0.1)


@pytest.mark.parametrize("name", FIELDS)
def test_dopri5_takes_n_steps_at_order_five(name):
    field = FIELDS[name]

    def error(n):
        return float((integrate(field, POINTS, n, "dopri5") - field.flow(POINTS)).norm())

    assert order_of(error, 16, 32) == pytest.approx(5, abs=0.25)


def test_dopri5_obeys_its_tolerance():
    field, errors = FIELDS["drifting vortex"], []
    for tolerance in (1e-4, 1e-7, 1e-10):
        found = integrate(field, POINTS, 1, "dopri5", tolerance=tolerance)
        errors.append(float((found - field.flow(POINTS)).abs().max()))
        assert errors[-1] < 50 * tolerance
    assert errors[0] > 100 * errors[1] > 10000 * errors[2]


@pytest.mark.parametrize("method", ["euler", "midpoint", "rk4", "dopri5"])
@pytest.mark.parametrize("inverse", [False, True])
def test_trajectory_ends_where_the_flow_does(method, inverse):
    field = FIELDS["drifting vortex"]
    path = trajectory(field, POINTS, 6, method, inverse)
    assert path.shape == (7, 20, 2)
    assert torch.equal(path[0], POINTS)
    torch.testing.assert_close(path[-1], integrate(field, POINTS, 6, method, inverse), rtol=1e-13, atol=1e-13)
    halfway = field.flow(POINTS, 1.0, 0.5) if inverse else field.flow(POINTS, 0.0, 0.5)
    assert float((path[3] - halfway).abs().max()) < 0.2


@pytest.mark.parametrize("method", ["euler", "rk4", "dopri5"])
def test_adjoint_reaches_every_tensor_of_the_field(method):
    field = grid_around(torch.zeros(1, 3).double(), margin=2.0, spacings=(2.0, 1.0), n_pieces=2)
    generator = np.random.default_rng(2)
    for level in field.levels:
        level.data = 0.2 * torch.from_numpy(generator.normal(size=level.shape))
    points = torch.from_numpy(generator.uniform(-1, 1, (6, 3))).requires_grad_()

    def gradients(kind):
        value = integrate(field, points, 48, method, gradient=kind).square().sum()
        return torch.cat([g.flatten() for g in torch.autograd.grad(value, [points, *field.levels])])

    direct, adjoint = gradients("direct"), gradients("adjoint")
    assert float((direct - adjoint).norm() / direct.norm()) < (0.05 if method == "euler" else 1e-4)


@pytest.mark.parametrize("method", ["rk4", "dopri5"])
def test_memory_of_the_adjoint_does_not_grow_with_the_steps(method):
    field = NetworkVelocity(2, 16, last_scale=1.0)

    def peak(n, kind):
        moving = POINTS.clone().requires_grad_()
        return peak_saved_bytes(lambda: integrate(field, moving, n, method, gradient=kind).sum().backward())

    assert peak(4, "adjoint") == peak(64, "adjoint")
    assert peak(64, "direct") > 10 * peak(4, "direct")
    assert peak(64, "direct") > 10 * peak(64, "adjoint")


@pytest.mark.parametrize(("method", "evaluations"), [("euler", 1), ("midpoint", 2), ("rk4", 4), ("dopri5", 7)])
@pytest.mark.parametrize("inverse", [False, True])
def test_takes_the_steps_it_is_asked_for_and_evaluates_as_often_as_it_says(method, evaluations, inverse):
    times = []

    def still(time, points):
        times.append(float(time))
        return torch.zeros_like(points)

    integrate(still, POINTS, 5, method, inverse)
    assert len(times) == 5 * evaluations
    assert min(times) > -1e-12
    assert max(times) < 1 + 1e-12
    starts = [1, 0.8, 0.6, 0.4, 0.2] if inverse else [0, 0.2, 0.4, 0.6, 0.8]
    assert times[::evaluations] == pytest.approx(starts, abs=1e-12)


@pytest.mark.parametrize("method", ["euler", "midpoint", "rk4", "dopri5"])
def test_gradient_in_the_points(method):
    points = POINTS[:3].clone().requires_grad_()
    assert torch.autograd.gradcheck(lambda x: integrate(logistic, x, 3, method), (points,))
    assert integrate(logistic, POINTS.float(), 3, method).dtype == torch.float32


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"n_steps": 0}, "n_steps is 0"),
        ({"method": "heun"}, "one of euler, midpoint, rk4, dopri5"),
        ({"gradient": "exact"}, "one of direct, adjoint"),
        ({"tolerance": 1e-3}, "the method dopri5 are needed"),
        ({"tolerance": 0.0, "method": "dopri5"}, "a number > 0"),
        ({"points": torch.full((2, 2), math.nan)}, "NaN"),
    ],
)
def test_doors(arguments, words):
    refuses(words, integrate, **{"field": logistic, "points": POINTS} | arguments)


def test_doors_behind_the_annotations(unchecked):
    refuses("one row per item", integrate, logistic, POINTS[0])


@pytest.mark.parametrize("dtype", [torch.float16, torch.bfloat16])
@pytest.mark.parametrize("gradient", ["direct", "adjoint"])
def test_half_precision_moves_in_the_dtype_of_the_field(dtype, gradient):
    field = NetworkVelocity(2, 8).float()
    with torch.no_grad():
        for parameter in field.parameters():
            parameter.normal_(0, 0.5, generator=torch.Generator().manual_seed(0))
    points = POINTS.to(dtype).requires_grad_()
    moved = integrate(field, points, 12, gradient=gradient)
    exact = integrate(field, points.detach().float(), 12)
    assert moved.dtype == dtype
    assert torch.equal(moved, exact.to(dtype))
    assert torch.equal(trajectory(field, points, 12)[-1], moved)
    moved.float().sum().backward()
    assert points.grad.dtype == dtype
    assert bool(torch.isfinite(points.grad).all())
