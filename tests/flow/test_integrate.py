import math

import numpy as np
import pytest
import torch

from meshot.flow.integrate import integrate


def spiral(time, points):
    """v = (1 + t)·A x with A = [[a, −b], [b, a]]: x(1) = exp(3A/2) x, a rotation by 3b/2 and growth by e^{3a/2}."""
    matrix = torch.tensor([[0.3, -1.2], [1.2, 0.3]], dtype=points.dtype)
    return (1 + time) * points @ matrix.T


def spiral_flow(points):
    angle, growth = 1.8, math.exp(0.45)
    turn = [[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]]
    return growth * points @ torch.tensor(turn, dtype=points.dtype).T


def logistic(time, points):
    return points * (1 - points)


def logistic_flow(points):
    return points * math.e / (1 - points + points * math.e)


FLOWS = {"spiral": (spiral, spiral_flow), "logistic": (logistic, logistic_flow)}
POINTS = torch.from_numpy(np.random.default_rng(0).uniform(0.1, 0.9, (20, 2)))


@pytest.mark.parametrize("name", FLOWS)
@pytest.mark.parametrize(("method", "order"), [("euler", 1), ("midpoint", 2), ("rk4", 4)])
@pytest.mark.parametrize("inverse", [False, True])
def test_order_of_convergence(name, method, order, inverse):
    field, flow = FLOWS[name]
    exact = POINTS if inverse else flow(POINTS)
    start = flow(POINTS) if inverse else POINTS
    errors = [float((integrate(field, start, n, method, inverse) - exact).norm()) for n in (40, 80)]
    assert math.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.1)


def test_takes_the_steps_it_is_asked_for():
    times = []

    def still(time, points):
        times.append(float(time))
        return torch.zeros_like(points)

    integrate(still, POINTS, 5)
    assert times == pytest.approx([0, 0.2, 0.4, 0.6, 0.8], abs=1e-12)
    times.clear()
    integrate(still, POINTS, 3, inverse=True)
    assert times == pytest.approx([1, 2 / 3, 1 / 3], abs=1e-12)


def test_one_euler_step_by_hand():
    torch.testing.assert_close(integrate(logistic, POINTS, 1), POINTS + POINTS * (1 - POINTS))


@pytest.mark.parametrize("method", ["euler", "midpoint", "rk4"])
def test_gradient_in_the_points(method):
    points = POINTS[:3].clone().requires_grad_()
    assert torch.autograd.gradcheck(lambda x: integrate(logistic, x, 3, method), (points,))
    assert integrate(logistic, POINTS.float(), 3, method).dtype == torch.float32


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"n_steps": 0}, "n_steps is 0"),
        ({"method": "dopri5"}, "one of euler, midpoint, rk4"),
        ({"points": torch.full((2, 2), math.nan)}, "NaN"),
    ],
)
def test_doors(arguments, words):
    with pytest.raises(ValueError, match=words):
        integrate(**({"field": logistic, "points": POINTS} | arguments))


def test_doors_behind_the_annotations(unchecked):
    with pytest.raises(ValueError, match="one row per item"):
        integrate(logistic, POINTS[0])
