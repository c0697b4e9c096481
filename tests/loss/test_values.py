"""Chamfer, exact and sliced Wasserstein: closed forms, POT, slow twins, gradients and doors."""

from functools import partial

import numpy as np
import pytest
import torch
from scipy.optimize import linear_sum_assignment

import problems
from meshot import (
    DiscreteMeasure,
    chamfer,
    quasi_directions,
    random_directions,
    sinkhorn_divergence,
    sliced_wasserstein,
    wasserstein,
    windowed_sliced_wasserstein,
)
from meshot.loss.sliced import plain_sliced_wasserstein, slice_costs
from meshot.loss.unbalanced import sliced_partial, sliced_unbalanced, unbalanced_sliced
from meshot_book.lines import translation_spread
from refusals import refuses

CASES = [
    problems.translation(0, 40, 2),
    problems.translation(1, 30, 3),
    problems.translation(2, 30, 6),
    problems.dilation(3, 40, 3, 1.8),
    problems.dilation(4, 40, 2, 0.3),
    problems.two_diracs(2, 1),
    problems.two_diracs(3, 1.5),
    problems.two_diracs(3, 3),
]
cases = pytest.mark.parametrize("problem", CASES, ids=lambda p: p.name)


@cases
def test_sliced_has_its_closed_form(problem):
    d = problem.source.points.shape[1]
    directions = quasi_directions(2**14, d)
    value = sliced_wasserstein(problem.source, problem.target, directions, problem.p)
    assert float(value) == pytest.approx(problem.sliced, rel=3e-3)


@cases
def test_wasserstein_has_its_closed_form(problem):
    assert float(wasserstein(problem.source, problem.target, problem.p)) == pytest.approx(problem.wasserstein, rel=1e-9)


@pytest.mark.parametrize(
    "loss",
    [
        sliced_wasserstein,
        plain_sliced_wasserstein,
        slice_costs,
        partial(sliced_partial, reach=1.0),
        partial(sliced_unbalanced, reach=1.0),
        partial(unbalanced_sliced, reach=1.0),
    ],
)
def test_a_hundred_even_directions_are_the_default(loss):
    """The number that the paper uses, and the documented set. Another number changes every value by more than 1e-6."""
    source, target = problems.cloud(0, 12, 3), problems.cloud(1, 15, 3, weighted=True)
    expected = loss(source, target, directions=quasi_directions(100, 3, seed=0))
    torch.testing.assert_close(loss(source, target), expected, rtol=1e-12, atol=0)


def test_a_hundred_even_directions_a_window_are_the_default():
    source, target, centre = problems.cloud(0, 12, 3), problems.cloud(1, 15, 3), torch.zeros(1, 3, dtype=torch.float64)
    expected = windowed_sliced_wasserstein(source, target, centre, 2.0, quasi_directions(100, 3, seed=0)[None])
    torch.testing.assert_close(windowed_sliced_wasserstein(source, target, centre, 2.0), expected, rtol=1e-12, atol=0)


def test_splitting_a_point_changes_nothing():
    source, target = problems.cloud(0, 9, 2, weighted=True), problems.cloud(1, 7, 2, weighted=True)
    halves = DiscreteMeasure(source.points.repeat(2, 1), source.weights.repeat(2) / 2)
    directions = random_directions(12, 2, 0)
    for loss in (lambda a, b: sliced_wasserstein(a, b, directions), wasserstein, chamfer):
        assert float(loss(halves, target)) == pytest.approx(float(loss(source, target)), rel=1e-9)


@pytest.mark.parametrize("loss", [chamfer, partial(wasserstein, p=1), wasserstein])
def test_gradients(loss):
    assert torch.autograd.gradcheck(loss, [problems.cloud(seed, 6, 3).points.requires_grad_() for seed in (0, 1)])


@pytest.mark.parametrize("scale", [1e-12, 1e-3, 1.0, 1e12])
@pytest.mark.parametrize("p", [1, 2, 3])
def test_the_scale_of_exact_transport_does_not_matter(p, scale):
    """Against SciPy's assignment of the points at scale one; the tolerance of POT's solver is absolute."""
    source, target = problems.cloud(0, 40, 3), problems.cloud(1, 40, 3)
    costs = np.linalg.norm(source.points.numpy()[:, None] - target.points.numpy(), axis=2) ** p
    expected = costs[linear_sum_assignment(costs)].mean()
    points = (scale * source.points).requires_grad_()
    value = wasserstein(DiscreteMeasure(points), DiscreteMeasure(scale * target.points), p)
    assert float(value.detach()) == pytest.approx(expected * scale**p, rel=1e-9)
    value.backward()
    unscaled = source.points.clone().requires_grad_()
    wasserstein(DiscreteMeasure(unscaled), target, p).backward()
    torch.testing.assert_close(points.grad, unscaled.grad * scale ** (p - 1), rtol=1e-9, atol=0)


@pytest.mark.parametrize("loss", [chamfer, wasserstein])
def test_a_value_beyond_the_dtype_is_refused(loss):
    plane = DiscreteMeasure(torch.eye(2, dtype=torch.float64) * 1e155)
    with pytest.raises(ValueError, match=r"scale both (measures )?down"):
        loss(plane, DiscreteMeasure(-plane.points))
    half = DiscreteMeasure(torch.eye(2) * 1e20)
    with pytest.raises(ValueError, match=r"exceeds? torch.float32"):
        loss(half, DiscreteMeasure(-half.points))


@pytest.mark.parametrize("p", [0.5, np.inf, np.nan])
def test_exponents_below_one_or_without_number_are_refused(p):
    plane = DiscreteMeasure(torch.zeros(2, 2))
    for loss in (wasserstein, lambda a, b, p: sliced_wasserstein(a, b, torch.eye(2), p)):
        refuses("a finite number >= 1", loss, plane, plane, p)
    refuses("a finite number >= 1", translation_spread, 3, p)
    refuses("blur is inf; a finite number", sinkhorn_divergence, plane, plane, blur=np.inf)


def test_an_unfinished_solver_is_an_error():
    refuses("did not finish", wasserstein, problems.cloud(0, 60, 2), problems.cloud(1, 60, 2), max_iterations=1)
