"""What the guard sees: Jacobians with known values, the step they ask for, and faces that cross."""

import math

import numpy as np
import pytest
import torch

from meshot.flow.crossings import crossings_along, inspect_paths, point_jacobians, steps_below
from meshot.flow.integration import METHODS, trajectory
from meshot.mesh.connectivity import self_intersecting_faces
from meshot_book.examples.counterexample import crossing_time, tip_over_face
from meshot_book.examples.unsteady import Accelerated
from meshot_book.flows import Push, Vortex, rotation, spiral

POINTS = torch.from_numpy(np.random.default_rng(0).uniform(-1, 1, (30, 2)))

PAIR = tip_over_face(0.3)


def test_jacobians_of_a_known_map():
    found = point_jacobians(lambda x: torch.stack([x[:, 0] * x[:, 1], x[:, 1] ** 2], dim=1), POINTS)
    x, y = POINTS.unbind(dim=1)
    torch.testing.assert_close(found, torch.stack([torch.stack([y, x], dim=1), torch.stack([0 * y, 2 * y], dim=1)], 1))
    assert not point_jacobians(lambda x: torch.ones_like(x), POINTS).any()


def test_rotation_by_euler_steps():
    report = inspect_paths(rotation(2.0), POINTS, 5)
    np.testing.assert_allclose(report.norms, 2.0)
    np.testing.assert_allclose(report.determinants, 1 + (2 / 5) ** 2)
    np.testing.assert_allclose(report.volume_factors, (1 + (2 / 5) ** 2) ** 5)
    assert report.step_times_lipschitz == pytest.approx(0.4)
    assert report.safe_steps == 3
    assert report.n_flips == 0
    assert torch.equal(report.positions, trajectory(rotation(2.0), POINTS, 5))


@pytest.mark.parametrize("method", METHODS)
def test_growth_of_a_volume_is_that_of_the_exact_flow(method):
    field = Accelerated(spiral(1.0, 0.4), 0.5)
    factors = inspect_paths(field, POINTS, 64, method).volume_factors
    assert float((factors - math.exp(0.8 * 1.25)).abs().max()) < (0.06 if method == "euler" else 1e-3)


def test_steps_too_long_flip():
    field = spiral(0.0, -3.0)  # x ↦ (1 − 3h) x
    assert inspect_paths(field, POINTS, 4).n_flips == 0
    # In the plane both axes turn round and the determinant is positive again; on a line it is not.
    assert inspect_paths(field, POINTS, 2).n_flips == 0

    def along_x(time, points):
        return -3 * points * torch.tensor([1.0, 0.0], dtype=points.dtype)

    report = inspect_paths(along_x, POINTS, 2)
    assert report.n_flips == 2 * len(POINTS)
    assert report.safe_steps == 4


@pytest.mark.parametrize(("lipschitz", "share", "steps"), [(0.0, 1, 1), (3.0, 1, 4), (2.9, 1, 3), (3.0, 0.5, 7)])
def test_steps_below(lipschitz, share, steps):
    assert steps_below(lipschitz, share) == steps
    assert lipschitz / steps < share
    assert steps == 1 or lipschitz / (steps - 1) >= share


@pytest.mark.parametrize(
    ("arguments", "words"), [((math.inf,), "no step"), ((-1.0,), "no step"), ((1.0, 0.0), "share is 0.0")]
)
def test_doors(arguments, words):
    with pytest.raises(ValueError, match=words):
        steps_below(*arguments)


def test_doors_of_the_counterexample():
    with pytest.raises(ValueError, match="gap is 0"):
        tip_over_face(0.0)
    with pytest.raises(ValueError, match=r"strength is 1\.0"):
        crossing_time(0.3, Push(1.0, 0.3))


def test_a_diffeomorphism_of_points_lets_triangles_cross():
    field = Push(-1.0, 0.3)
    assert crossings_along(field, PAIR, 10) == [0, 0, 0, 0, *[2] * 7]
    report = inspect_paths(field, PAIR.vertices, 10)
    assert report.n_flips == 0
    np.testing.assert_allclose(report.determinants, 1)
    assert float(field.lipschitz_bound()) / 10 < 1


@pytest.mark.parametrize(("gap", "strength", "width"), [(0.3, -1.0, 0.3), (0.5, -0.9, 0.5)])
def test_the_moment_of_crossing(gap, strength, width):
    pair, field = tip_over_face(gap), Push(strength, width)
    moment = crossing_time(gap, field)
    for time, n_faces in ((moment - 1e-9, 0), (moment + 1e-9, 2)):
        assert len(self_intersecting_faces(pair.with_vertices(field.flow(pair.vertices, 0.0, time)))) == n_faces


def test_far_points_of_the_vortex_feel_nothing():
    report = inspect_paths(Vortex(5.0, 0.1), POINTS + 10, 3)
    assert report.steepest < 1e-12
    assert report.safe_steps == 1
