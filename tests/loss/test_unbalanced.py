"""Sliced partial and unbalanced transport: linear programs, POT, closed forms, duality, axioms, gradients, refusals."""

import itertools

import numpy as np
import ot
import pytest
import scipy.optimize
import torch

import problems
from meshot import quasi_directions, sliced_wasserstein
from meshot.loss import sliced_partial, sliced_unbalanced, unbalanced_sliced
from meshot.loss.directions import random_directions
from meshot.measure.discrete import DiscreteMeasure
from refusals import refuses

LINE = torch.ones(1, 1, dtype=torch.float64)
CASES = ("generic", "zero weights", "ties", "identical", "one point", "lattice masses")
BOTH = pytest.mark.parametrize("loss", [sliced_partial, sliced_unbalanced])
ALL = pytest.mark.parametrize("loss", [sliced_partial, sliced_unbalanced, unbalanced_sliced])


def on_a_line(name, seed=0):
    """Positions and masses of both sides."""
    random = np.random.default_rng(seed)
    n, m = (1, 9) if name == "one point" else (8, 9)
    x, y, a, b = random.normal(size=n) * 3, random.normal(size=m) * 3, random.random(n) + 0.05, random.random(m) + 0.05
    if name == "zero weights":
        a[:3], b[4:] = 0, 0
    if name == "ties":
        x, y = np.round(x / 2), np.round(y / 2)
    if name == "identical":
        x, a = y[::-1].copy(), b[::-1].copy()
    if name == "lattice masses":
        a, b = random.integers(1, 4, n).astype(float), random.integers(1, 4, m).astype(float)
    return x, a / a.sum(), y, b / b.sum()


def measures(x, a, y, b):
    return [DiscreteMeasure(torch.from_numpy(p)[:, None], torch.from_numpy(w)) for p, w in ((x, a), (y, b))]


def with_gradients(loss, arrays, reach, **settings):
    x, a, y, b = (torch.from_numpy(array).requires_grad_() for array in arrays)
    value = loss(DiscreteMeasure(x[:, None], a), DiscreteMeasure(y[:, None], b), reach, LINE, **settings)
    return float(value.detach()), *(g.numpy() for g in torch.autograd.grad(value, (x, a, y, b)))


def partial_by_linear_program(x, a, y, b, reach):
    n, m = len(x), len(y)
    costs = (np.abs(x[:, None] - y) - reach).ravel()
    sums = np.vstack([np.kron(np.eye(n), np.ones(m)), np.kron(np.ones(n), np.eye(m))])
    found = scipy.optimize.linprog(costs, A_ub=sums, b_ub=np.concatenate([a, b]), method="highs")
    return found.fun + reach


def unbalanced_by_newton(x, a, y, b, scale):
    """The dual problem by a general solver of SciPy."""
    z = np.unique(np.concatenate([x, y]))
    here, there = (np.array([w[p == q].sum() for q in z]) for p, w in ((x, a), (y, b)))
    rises = np.diff(np.eye(len(z)), axis=0)
    found = scipy.optimize.minimize(
        lambda f: -scale * (here * (1 - np.exp(-f / scale)) + there * (1 - np.exp(f / scale))).sum(),
        np.zeros(len(z)),
        jac=lambda f: there * np.exp(f / scale) - here * np.exp(-f / scale),
        constraints={
            "type": "ineq",
            "fun": lambda f: np.concatenate([np.diff(z) - rises @ f, np.diff(z) + rises @ f]),
            "jac": lambda f: np.concatenate([-rises, rises]),
        },
        method="SLSQP",
        options={"ftol": 1e-14, "maxiter": 1000},
    )
    return -found.fun


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("reach", [0.05, 1.0, 4.0, 60.0])
def test_partial_cost_is_that_of_the_linear_program(name, reach):
    arrays = on_a_line(name)
    found = float(sliced_partial(*measures(*arrays), reach, LINE))
    assert found == pytest.approx(partial_by_linear_program(*arrays, reach), abs=1e-12)


@pytest.mark.parametrize("reach", [0.3, 1.0, 3.0])
def test_partial_costs_of_pot(reach):
    """Equal masses: the marginal costs of Chapel and Tavenard below the reach. Any masses: the Lagrangian form."""
    random = np.random.default_rng(1)
    x, y, equal = random.normal(size=30), random.normal(size=30) + 0.4, np.full(30, 1 / 30)
    costs = np.array(ot.partial.partial_wasserstein_1d(x, y)[2]) - reach
    found = float(sliced_partial(*measures(x, equal, y, equal), reach, LINE))
    assert found == pytest.approx(reach + costs[costs < 0].sum() / 30, abs=1e-12)
    x, a, y, b = on_a_line("generic")
    distances = np.abs(x[:, None] - y)
    plan = ot.partial.partial_wasserstein_lagrange(a, b, distances, reach)
    expected = (plan * distances).sum() + reach * (1 - plan.sum())
    assert float(sliced_partial(*measures(x, a, y, b), reach, LINE)) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("scale", [0.1, 1.0, 20.0])
def test_unbalanced_cost_is_that_of_a_general_solver(name, scale):
    arrays = on_a_line(name)
    found = float(sliced_unbalanced(*measures(*arrays), 2 * scale, LINE))
    assert found == pytest.approx(unbalanced_by_newton(*arrays, scale), rel=1e-7, abs=1e-9)


def test_unbalanced_cost_of_pot():
    """Multiplicative updates of POT, which approach the minimum from above."""
    x, a, y, b = on_a_line("generic")
    distances, scale = np.abs(x[:, None] - y), 1.5
    plan = ot.unbalanced.mm_unbalanced(a, b, distances, scale, div="kl", numItermax=200_000, stopThr=1e-15)

    def penalty(kept, given):
        return scale * (kept * np.log(kept / given) - kept + given).sum()

    expected = (plan * distances).sum() + penalty(plan.sum(1), a) + penalty(plan.sum(0), b)
    assert float(sliced_unbalanced(*measures(x, a, y, b), 2 * scale, LINE)) == pytest.approx(expected, rel=1e-5)
    one = float(unbalanced_sliced(*measures(x, a, y, b), 2 * scale, LINE, p=1, tolerance=1e-3, n_iterations=5000))
    assert one == pytest.approx(expected, rel=2e-3)


def test_unbalanced_cost_has_the_unit_of_length():
    """Every Newton step scales with the unit, from a reach far below the gaps to one far above the measures."""
    random = np.random.default_rng(0)
    for _ in range(100):
        n, m = random.integers(1, 30, 2)
        x, y, a, b = random.normal(size=n), random.normal(size=m), random.random(n) ** 6, random.random(m) ** 6
        reach = 10 ** random.uniform(-3, 3)
        one, other = (
            float(sliced_unbalanced(*measures(unit * x, a / a.sum(), unit * y, b / b.sum()), unit * reach, LINE)) / unit
            for unit in (1, 1000)
        )
        assert other == pytest.approx(one, rel=2e-10)  # the relative error of each is at most 1e-10


@pytest.mark.parametrize("p", [1, 2])
def test_unbalanced_sliced_transport_of_pot(p):
    """The same method, at a reach at which POT's ten thousand steps of 2/(k + 2) are enough."""
    source, target = problems.cloud(0, 30, 3, True), problems.cloud(1, 25, 3, True)
    lines, reach = random_directions(6, 3, 0), 3.0
    found = unbalanced_sliced(source, target, reach, lines, p, tolerance=1e-4, n_iterations=3000)
    theirs = ot.unbalanced_sliced_ot(
        source.points, target.points, reach**p / 2, source.weights, target.weights,
        p=p, projections=lines.T, numItermax=3000,
    )[2]  # fmt: skip
    assert float(found) == pytest.approx(float(theirs), rel=2e-3)


@pytest.mark.parametrize("gap", [0.5, 4.0, 30.0])
def test_two_points(gap):
    x, one = np.zeros(1), np.ones(1)
    pair = measures(x, one, x + gap, one)
    assert float(sliced_partial(*pair, 5.0, LINE)) == pytest.approx(min(gap, 5.0), rel=1e-12)
    assert float(sliced_unbalanced(*pair, 5.0, LINE)) == pytest.approx(5 * (1 - np.exp(-gap / 5)), rel=1e-9)
    for p in (1, 2):
        expected = 5**p * (1 - np.exp(-((gap / 5) ** p)))
        assert float(unbalanced_sliced(*pair, 5.0, LINE, p)) == pytest.approx(expected, rel=1e-9)


@BOTH
def test_a_long_reach_leaves_the_sliced_loss_and_a_short_one_only_what_is_common(loss):
    source, target = problems.cloud(0, 60, 3, True), problems.cloud(1, 45, 3, True)
    lines = quasi_directions(9, 3)
    whole = float(sliced_wasserstein(source, target, lines, 1))
    assert float(loss(source, target, 1e5, lines)) == pytest.approx(whole, rel=1e-4)
    values = [float(loss(source, target, reach, lines)) for reach in (1e-3, 0.1, 1.0, 10.0)]
    assert all(one < other <= whole for one, other in itertools.pairwise(values))
    assert values[0] == pytest.approx(1e-3, rel=0.05)  # all mass is removed and added, since no points coincide


@BOTH
@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("reach", [0.5, 5.0])
def test_potentials_are_dual(loss, name, reach):
    """They satisfy the constraints of the dual problem, and their value is the cost: both are therefore optimal."""
    x, a, y, b = arrays = on_a_line(name)
    value, _, of_x, _, of_y = with_gradients(loss, arrays, reach)
    scale = reach / 2
    if loss is sliced_partial:
        f, g, dual = of_x, of_y, a @ of_x + b @ of_y
        assert max(np.abs(f).max(), np.abs(g).max()) <= scale + 1e-12
    else:
        f, g = (-scale * np.log(1 - np.minimum(of, scale * (1 - 1e-16)) / scale) for of in (of_x, of_y))
        dual = a @ of_x + b @ of_y
    assert dual == pytest.approx(value, rel=1e-8, abs=1e-10)
    assert (f[:, None] + g - np.abs(x[:, None] - y)).max() < 1e-7


@BOTH
@pytest.mark.parametrize("reach", [0.5, 2.0, 8.0])
def test_gradients_by_differences(loss, reach):
    arrays = on_a_line("generic", seed=3)
    found = with_gradients(loss, arrays, reach)[1:]
    step = 1e-5
    for k, array in enumerate(arrays):
        for i in range(len(array)):
            sides = []
            for sign in (1, -1):
                moved = [values.copy() for values in arrays]
                moved[k][i] += sign * step
                if k % 2:
                    moved[k] /= moved[k].sum()
                sides.append(float(loss(*measures(*moved), reach, LINE)))
            expected = found[k][i] - (found[k] @ array if k % 2 else 0)
            assert (sides[0] - sides[1]) / (2 * step) == pytest.approx(expected, abs=3e-5)


def test_gradients_of_unbalanced_sliced_transport():
    source, target = problems.cloud(0, 9, 3, True), problems.cloud(1, 8, 3, True)
    lines, points = random_directions(4, 3, 0), source.points.clone().requires_grad_()

    def value(points):
        return unbalanced_sliced(DiscreteMeasure(points, source.weights), target, 6.0, lines, 2, 1e-7, 100_000)

    (gradient,) = torch.autograd.grad(value(points), points)
    for i, k in ((0, 0), (3, 1), (7, 2)):
        step = torch.zeros_like(source.points)
        step[i, k] = 1e-3
        rise = float(value(source.points + step) - value(source.points - step)) / 2e-3
        assert rise == pytest.approx(float(gradient[i, k]), rel=0.02, abs=1e-4)


@BOTH
def test_axioms(loss):
    """A metric after a root: partial transport as it is, unbalanced transport by its square root."""
    lines, power = quasi_directions(5, 3), 1 if loss is sliced_partial else 0.5
    for seed in range(15):
        triple = [problems.cloud(3 * seed + k, 6 + 4 * k, 3, True) for k in range(3)]
        legs = [float(loss(*pair, 1.5, lines)) ** power for pair in itertools.combinations(triple, 2)]
        assert max(legs) <= sum(legs) - max(legs) + 1e-9
        assert float(loss(triple[1], triple[0], 1.5, lines)) ** power == pytest.approx(legs[0], rel=1e-7)
        assert abs(float(loss(triple[0], triple[0], 1.5, lines))) < 1e-11


def test_the_square_root_is_needed():
    """Points at 0, 2 and 4: without the root, the unbalanced cost with p = 2 breaks the triangle inequality."""
    x, one = np.zeros(1), np.ones(1)
    places = [measures(x + shift, one, x, one)[0] for shift in (0.0, 2.0, 4.0)]
    whole, first, second = (
        float(unbalanced_sliced(places[i], places[j], 4.0, LINE, 2)) for i, j in ((0, 2), (0, 1), (1, 2))
    )
    assert whole > first + second
    assert whole**0.5 < first**0.5 + second**0.5


@ALL
@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"reach": 0.0}, "reach is 0.0; a finite number > 0 is needed"),
        ({"reach": float("nan")}, "reach is nan"),
        ({"reach": float("inf")}, "reach is inf"),
        ({"directions": torch.ones(2, 3, dtype=torch.float64)}, "unit rows are needed"),
        ({"directions": torch.eye(3, dtype=torch.float64).requires_grad_()}, "directions requires a gradient"),
        ({"target": problems.cloud(1, 9, 2)}, "R\\^2"),
    ],
)
def test_what_does_not_fit_is_refused(loss, change, words):
    given = {"source": problems.cloud(0, 9, 3), "target": problems.cloud(1, 9, 3), "reach": 1.0, "directions": 3}
    refuses(words, loss, **given | change)


def test_an_answer_that_is_not_good_enough_is_refused():
    pair = problems.cloud(0, 40, 3), problems.cloud(1, 40, 3)
    with pytest.raises(ValueError, match=r"duality gap is .* after 5 iterations; at most 0\.01 is needed"):
        unbalanced_sliced(*pair, 0.05, 4, n_iterations=5)
    for change, words in (({"tolerance": 2.0}, "tolerance is 2.0"), ({"n_iterations": 0}, "n_iterations is 0")):
        refuses(words, unbalanced_sliced, *pair, 1.0, 4, **change)
