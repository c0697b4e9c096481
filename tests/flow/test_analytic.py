"""Flows in closed form against another solver, and Lipschitz constants against what is seen."""

import math

import numpy as np
import pytest
import torch
from scipy.integrate import solve_ivp

from meshot.flow.crossings import sampled_lipschitz
from meshot_book.examples.unsteady import Accelerated, Drifting, RootSink
from meshot_book.flows import Affine, Push, Vortex, rotation, shear, spiral

DRIFT = torch.tensor([0.7, -0.4], dtype=torch.float64)
FIELDS = {
    "rotation": rotation(1.3),
    "spiral": spiral(-2.0, 0.5),
    "shear": shear(1.5),
    "affine": Affine(torch.tensor([[0.2, 1.0], [-0.3, -0.6]]).double(), DRIFT),
    "vortex": Vortex(2.5, 0.8),
    "push": Push(-1.2, 0.5),
    "accelerated vortex": Accelerated(Vortex(2.0, 0.8), -1.7),
    "drifting vortex": Drifting(Vortex(2.0, 0.8), DRIFT),
}
POINTS = torch.from_numpy(np.random.default_rng(0).uniform(-1.5, 1.5, (8, 2)))


def solved(field, points, start, end):
    """Another library's answer, to ten digits."""

    def velocity(time, flat):
        at = torch.tensor(time, dtype=torch.float64)
        return field(at, torch.from_numpy(flat.reshape(points.shape))).numpy().ravel()

    found = solve_ivp(velocity, (start, end), points.numpy().ravel(), method="DOP853", rtol=1e-11, atol=1e-12)
    return torch.from_numpy(found.y[:, -1].reshape(points.shape))


@pytest.mark.parametrize("name", FIELDS)
@pytest.mark.parametrize(("start", "end"), [(0.0, 1.0), (1.0, 0.0), (0.3, 0.8)])
def test_flow_solves_the_equation(name, start, end):
    field = FIELDS[name]
    torch.testing.assert_close(field.flow(POINTS, start, end), solved(field, POINTS, start, end), rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("name", FIELDS)
def test_the_constant_is_reached_and_not_passed(name):
    field, bound = FIELDS[name], float(FIELDS[name].lipschitz_bound())
    axis = torch.linspace(-2, 2, 81, dtype=torch.float64)
    seen = float(sampled_lipschitz(field, torch.cartesian_prod(axis, axis), n_times=40))
    assert field.is_lipschitz
    assert 0.97 * bound < seen < bound * (1 + 1e-9)


@pytest.mark.parametrize("field", [Vortex(2.0, 0.8), Push(1.0, 0.5)])
def test_in_space_as_in_the_plane(field):
    points = torch.cat([POINTS, 0 * POINTS[:, :1]], dim=1)
    moved = field.flow(points)
    torch.testing.assert_close(moved[:, :2], field.flow(POINTS))
    assert not moved[:, 2].any()
    torch.testing.assert_close(moved, solved(field, points, 0.0, 1.0), rtol=1e-8, atol=1e-8)
    away = field.flow(points + torch.tensor([0.0, 0.0, 5.0], dtype=torch.float64))
    assert float((away - points)[:, :2].abs().max()) < 1e-9 or isinstance(field, Vortex)


def test_root_sink_is_not_lipschitz_and_its_points_meet():
    field, points = RootSink(), torch.tensor([[0.04], [-0.09], [4.0]], dtype=torch.float64)
    assert not field.is_lipschitz
    assert float(field.lipschitz_bound()) == math.inf
    torch.testing.assert_close(field.flow(points, 0.0, 0.15), solved(field, points, 0.0, 0.15), rtol=1e-7, atol=1e-7)
    assert torch.equal(field.flow(points)[:2], torch.zeros(2, 1).double())
    assert float(sampled_lipschitz(field, points * 1e-8)) > 1e3
    with pytest.raises(ValueError, match="no inverse"):
        field.flow(points, 1.0, 0.0)


def test_dtype_follows_the_points():
    for field in FIELDS.values():
        assert field.flow(POINTS.float()).dtype == torch.float32
        assert field(torch.tensor(0.5), POINTS.float()).dtype == torch.float32


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Affine(torch.zeros(2, 3)), r"\(d, d\) is needed"),
        (lambda: Affine(torch.zeros(2, 2), torch.zeros(3)), r"\(2,\) is needed"),
        (lambda: Vortex(1.0, 0.0), "radius is 0.0"),
        (lambda: Push(1.0, -1.0), "width is -1.0"),
        (lambda: Drifting(Vortex(1.0), torch.tensor([math.nan, 0.0])), "NaN"),
    ],
)
def test_doors(unchecked, make, words):
    with pytest.raises(ValueError, match=words):
        make()
