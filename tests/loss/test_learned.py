"""Searched, weighted, corrected and lifted slices: closed forms, POT, bounds, gradients and doors."""

import functools

import numpy as np
import ot
import pytest
import torch

import problems
from meshot import DiscreteMeasure, random_directions, slice_costs, sliced_wasserstein, wasserstein
from meshot.loss import (
    controlled_sliced_wasserstein,
    energy_sliced_wasserstein,
    hilbert_transport,
    max_sliced_direction,
    max_sliced_wasserstein,
    min_sliced_plan,
    min_sliced_transport,
    quantile_cost,
)
from meshot.loss.learned import CONTROLS, bound_control, hilbert_index, line_costs, monotone_plans, quadratic_controls
from refusals import refuses

LINES = random_directions(12, 3, 0)
LOSSES = {
    "max": functools.partial(max_sliced_wasserstein, directions=LINES, n_steps=0),
    "energy": functools.partial(energy_sliced_wasserstein, directions=LINES),
    "cubic energy": functools.partial(energy_sliced_wasserstein, directions=LINES, power=3),
    "exponential": functools.partial(energy_sliced_wasserstein, directions=LINES, temperature=0.7),
    "controlled": functools.partial(controlled_sliced_wasserstein, directions=LINES),
    "lower": functools.partial(controlled_sliced_wasserstein, directions=LINES, control="lower"),
    "upper": functools.partial(controlled_sliced_wasserstein, directions=LINES, control="upper"),
    "lifted": functools.partial(min_sliced_transport, directions=LINES),
    "curve": functools.partial(hilbert_transport, n_curves=2),
}
each = pytest.mark.parametrize("name", LOSSES)


def pair(n=9, m=7, d=3, weighted=True):
    return problems.cloud(0, n, d, weighted), problems.cloud(1, m, d, weighted)


# Gradients.


@each
@pytest.mark.parametrize("weighted", [True, False])
def test_gradients(name, weighted):
    source, target = pair(6, 5 if weighted else 6, weighted=weighted)

    def loss(x, y, *masses):
        sides = zip((x, y), [m / m.sum() for m in masses] or [None, None])
        return LOSSES[name](*(DiscreteMeasure(points, masses) for points, masses in sides))

    tensors = [source.points, target.points, *((source.weights, target.weights) if weighted else ())]
    assert torch.autograd.gradcheck(loss, [tensor.clone().requires_grad_() for tensor in tensors])


@pytest.mark.parametrize("p", [1, 1.5, 2])
def test_costs_have_the_gradient_of_each(p):
    """Factors of both signs and zero, against PyTorch operations."""
    source, target = pair(40, 30)
    factors = torch.linspace(-1, 1, 12, dtype=torch.float64).roll(3)
    factors[5] = 0
    found = []
    for costs in (line_costs, lambda *given: quantile_costs(*given)):
        points, masses = source.points.clone().requires_grad_(), source.weights.clone().requires_grad_()
        values = costs(DiscreteMeasure(points, masses), target, LINES, p)
        found.append([values, *torch.autograd.grad(factors @ values, (points, masses))])
        found[-1][2] = found[-1][2] - found[-1][2].mean()  # a potential, known up to a constant
    for one, other in zip(*found):
        torch.testing.assert_close(one, other, rtol=1e-9, atol=1e-11)


def quantile_costs(source, target, lines, p):
    return quantile_cost(lines @ source.points.T, source.weights, lines @ target.points.T, target.weights, p)


# The direction of largest cost.


def test_max_of_a_translation_is_its_squared_length():
    problem = problems.translation(0, 40, 6)
    found = max_sliced_wasserstein(problem.source, problem.target, 10)
    assert float(found) == pytest.approx(problem.wasserstein, rel=1e-9)
    shift = (problem.target.points - problem.source.points)[0]
    direction = max_sliced_direction(problem.source, problem.target, 10)
    assert abs(float(direction @ shift)) == pytest.approx(float(shift.norm()), rel=1e-9)


@pytest.mark.parametrize("d", [2, 3, 6])
def test_max_of_a_dilation_is_an_eigenvalue(d):
    """x → s x costs (s − 1)² θᵀSθ with the second moments S, at most (s − 1)² times their largest eigenvalue."""
    problem = problems.dilation(3, 40, d, 1.8)
    points, weights = problem.source.points, problem.source.weights
    largest = torch.linalg.eigvalsh((points * weights[:, None]).T @ points)[-1]
    found = max_sliced_wasserstein(problem.source, problem.target, 5, n_steps=300)
    assert float(found) == pytest.approx(0.64 * float(largest), rel=1e-9)


@pytest.mark.parametrize("p", [1, 2, 3])
def test_the_ascent_begins_at_the_maximum_of_pot_and_rises(p):
    source, target = pair(60, 50, 5)
    lines = random_directions(30, 5, 1)
    given = (array.numpy() for array in (source.points, target.points, source.weights, target.weights))
    start = ot.max_sliced_wasserstein_distance(*given, p=p, projections=lines.numpy().T) ** p
    values = [float(max_sliced_wasserstein(source, target, lines, p, n)) for n in (0, 3, 10, 40)]
    assert values[0] == pytest.approx(start, rel=1e-9)
    assert values == sorted(values)
    assert values[-1] > 1.05 * start
    # No direction nearby costs more, but for the kinks at which an ascent can stop.
    top = max_sliced_direction(source, target, lines, p, 400)
    near = top + 1e-3 * random_directions(300, 5, 2)
    costs = slice_costs(source, target, near / near.norm(dim=1, keepdim=True), p)
    assert float(costs.max()) < 1.001 * float(max_sliced_wasserstein(source, target, top[None], p, 0))


def test_two_orthogonal_lines_have_two_maxima_and_a_start_decides():
    """Mass leaves the origin along two axes, by 2 and by 1: both axes are maxima, the second is no global one."""
    source = torch.zeros(4, 2, dtype=torch.float64)
    target = torch.tensor([[2.0, 0], [-2, 0], [0, 1.0], [0, -1]], dtype=torch.float64)
    axes = torch.eye(2, dtype=torch.float64)
    assert float(max_sliced_wasserstein(source, target, axes)) == pytest.approx(2)
    assert float(max_sliced_wasserstein(source, target, axes[1:])) == pytest.approx(0.5)


# Weighted slices.


def test_energy_lies_between_the_mean_and_the_largest_cost():
    source, target = pair(30, 40)
    costs = slice_costs(source, target, LINES)
    by_power = [float(energy_sliced_wasserstein(source, target, LINES, power=a)) for a in (0, 1, 2, 5, 400)]
    by_heat = [float(energy_sliced_wasserstein(source, target, LINES, temperature=t)) for t in (1e3, 1, 0.3, 1e-3)]
    for values in (by_power, by_heat):
        assert values == sorted(values)
        assert values[0] == pytest.approx(float(costs.mean()), rel=1e-5)
        assert values[-1] == pytest.approx(float(costs.max()), rel=1e-3)
    assert by_power[1] == pytest.approx(float((costs**2).sum() / costs.sum()), rel=1e-12)
    weights = np.exp(costs.numpy() / 0.3**2)
    assert by_heat[2] == pytest.approx(float(weights @ costs.numpy() / weights.sum()), rel=1e-9)


def test_energy_of_a_translation_has_its_closed_form():
    """Along an angle φ the cost is |t|² cos² φ: with a = 1, the mean of cos⁴ over that of cos² is 3/4."""
    source = problems.cloud(0, 20, 2)
    target = DiscreteMeasure(source.points + torch.tensor([2.0, 0.0]))
    assert float(energy_sliced_wasserstein(source, target)) == pytest.approx(3.0, rel=1e-9)


@pytest.mark.parametrize("options", [{}, {"power": 2}, {"power": 0}, {"temperature": 1.0}])
def test_equal_measures_have_no_energy_and_no_gradient(options):
    points = problems.cloud(0, 10, 3).points.requires_grad_()
    value = energy_sliced_wasserstein(points, points.detach(), LINES, **options)
    (gradient,) = torch.autograd.grad(value, points)
    assert float(value.detach()) == 0
    assert float(gradient.abs().max()) == 0


# Corrected slices.


@pytest.mark.parametrize("control", ["quadratic", "lower"])
def test_controls_make_a_translation_exact(control):
    """Its cost is a quadratic form, which both explain: the lower bound is the cost itself."""
    problem = problems.translation(0, 40, 3)
    found = controlled_sliced_wasserstein(problem.source, problem.target, LINES, control=control)
    assert float(found) == pytest.approx(problem.sliced, rel=1e-12)


def test_the_upper_control_makes_a_dilation_exact():
    """x → s x about the mean costs (s − 1)² θᵀΣθ, and the upper bound is (s² + 1) θᵀΣθ."""
    source = problems.cloud(0, 20, 3)
    points = source.points - source.points.mean(dim=0)
    found = controlled_sliced_wasserstein(points, 2 * points, LINES, control="upper")
    assert float(found) == pytest.approx(float(points.square().sum(dim=1).mean()) / 3, rel=1e-9)


@pytest.mark.parametrize("control", CONTROLS)
def test_controls_have_mean_zero(control):
    source, target = pair()
    lines = random_directions(20_000, 3, 0)
    columns = quadratic_controls(lines) if control == "quadratic" else bound_control(source, target, lines, control)
    spread = columns.std(dim=0) / len(lines) ** 0.5
    assert bool((columns.mean(dim=0).abs() < 4 * spread).all())


def test_bounds_are_bounds():
    """Up to their means: ⟨θ, t⟩² ≤ W₂² ≤ the cost of independent partners."""
    source, target = pair()
    costs, d = slice_costs(source, target, LINES), 3
    low, high = (bound_control(source, target, LINES, control) for control in ("lower", "upper"))
    means = [measure.weights @ measure.points for measure in (source, target)]
    spreads = [float(m.weights @ (m.points - mean).square().sum(dim=1)) for m, mean in zip((source, target), means)]
    length = float((means[0] - means[1]).square().sum())
    gaps = (LINES @ source.points.T)[:, :, None] - (LINES @ target.points.T)[:, None]
    independent = torch.einsum("lij,i,j->l", gaps**2, source.weights, target.weights)
    torch.testing.assert_close(high + (length + sum(spreads)) / d, independent)
    assert bool((low + length / d <= costs).all())
    assert bool((high + (length + sum(spreads)) / d >= costs).all())


@pytest.mark.parametrize(("control", "at_least"), [("quadratic", 1.4), ("lower", 1.2)])
def test_controls_estimate_the_same_with_less_variance(control, at_least):
    source = problems.cloud(0, 60, 3)
    target = DiscreteMeasure(problems.cloud(1, 60, 3).points * torch.tensor([1.0, 1.5, 0.5]) + 0.3)
    truth = float(sliced_wasserstein(source, target, 20_000))
    errors = {"plain": [], "controlled": []}
    for seed in range(100):
        lines = random_directions(50, 3, seed)
        errors["plain"].append(float(sliced_wasserstein(source, target, lines)) - truth)
        found = controlled_sliced_wasserstein(source, target, lines, control=control)
        errors["controlled"].append(float(found) - truth)
    plain, controlled = (np.array(values) for values in errors.values())
    assert plain.std() > at_least * controlled.std()
    assert abs(controlled.mean()) < 4 * controlled.std() / 10 + 0.02 * truth  # a bias of order 1/L


def test_equal_means_leave_the_lower_bound_without_a_task():
    problem = problems.dilation(0, 20, 3, 2.0)
    centred = [DiscreteMeasure(m.points - m.weights @ m.points, m.weights) for m in (problem.source, problem.target)]
    found = controlled_sliced_wasserstein(*centred, LINES, control="lower")
    assert float(found) == pytest.approx(float(sliced_wasserstein(*centred, LINES)), rel=1e-9)


# Slices that lift to a plan.


@pytest.mark.parametrize(("n", "m", "weighted"), [(30, 30, False), (30, 20, False), (12, 17, True)])
@pytest.mark.parametrize("p", [1, 2])
def test_lifted_plan_is_the_cheapest_of_those_of_pot(n, m, weighted, p):
    """POT's plans, not its costs: between measures of unequal weights, version 0.9.7 returns costs of other plans."""
    source, target = pair(n, m, 3, weighted)
    x, y, a, b = (array.numpy() for array in (source.points, target.points, source.weights, target.weights))
    ground = np.linalg.norm(x[:, None] - y[None], axis=2) ** p
    plans, costs = ot.sliced.sliced_plans(x, y, a, b, projections=LINES.numpy().T, p=2)
    dense = np.zeros((len(plans), n, m))
    for matrix, plan in zip(dense, plans):
        np.add.at(matrix, (np.asarray(plan.rows), np.asarray(plan.cols)), np.asarray(plan.data))
    best = (dense * ground).sum(axis=(1, 2)).argmin()
    rows, columns, masses = min_sliced_plan(source, target, LINES, p)
    found = np.zeros((n, m))
    np.add.at(found, (rows.numpy(), columns.numpy()), masses.numpy())
    np.testing.assert_allclose(found, dense[best], atol=1e-12)
    cost = float(min_sliced_transport(source, target, LINES, p))
    assert cost == pytest.approx((dense[best] * ground).sum(), rel=1e-12)
    if n == m and p == 2:
        assert cost == pytest.approx(float(min(costs)), rel=1e-12)


@pytest.mark.parametrize("p", [1, 2, 3])
@pytest.mark.parametrize("d", [2, 3, 6])
def test_plans_cost_more_than_the_best_one(p, d):
    source, target = pair(25, 30, d)
    exact = float(wasserstein(source, target, p))
    lines = random_directions(12, d, 0)
    for found in (min_sliced_transport(source, target, lines, p), hilbert_transport(source, target, 1, p)):
        assert exact < float(found) < 20 * exact
    more = random_directions(200, d, 0)
    assert float(min_sliced_transport(source, target, more, p)) <= float(
        min_sliced_transport(source, target, more[:12], p)
    )


@pytest.mark.parametrize("problem", [problems.translation(1, 30, 3), problems.dilation(3, 40, 3, 1.8)])
def test_lifted_slices_are_exact_where_every_line_has_the_same_order(problem):
    found = min_sliced_transport(problem.source, problem.target, LINES)
    assert float(found) == pytest.approx(problem.wasserstein, rel=1e-9)


@pytest.mark.parametrize("loss", [min_sliced_transport, hilbert_transport])
def test_on_a_line_both_plans_are_exact(loss):
    source, target = pair(20, 15, 1)
    assert float(loss(source, target)) == pytest.approx(float(wasserstein(source, target)), rel=1e-9)


@pytest.mark.parametrize("sizes", [(8, 5), (6, 6)])
def test_monotone_plans_cost_what_transport_on_a_line_costs(sizes):
    source, target = pair(*sizes)
    x, y = LINES @ source.points.T, LINES @ target.points.T
    rows, columns, masses = monotone_plans(x, source.weights, y, target.weights)
    costs = (masses * (x.gather(1, rows) - y.gather(1, columns)).abs() ** 1.5).sum(dim=1)
    torch.testing.assert_close(costs, quantile_cost(x, source.weights, y, target.weights, 1.5))


def test_chunks_of_directions_change_nothing(monkeypatch):
    source, target = pair()
    whole = min_sliced_transport(source, target, LINES)
    monkeypatch.setattr("meshot.loss.learned._ROOM", 100)
    assert torch.equal(min_sliced_transport(source, target, LINES), whole)


# The curve.


def test_points_without_mass_do_not_change_the_curve():
    source, target = pair(8, 9)
    points, none = torch.cat([source.points, 100 + source.points[:1]]), source.weights.new_zeros(1)
    padded = DiscreteMeasure(points, torch.cat([source.weights, none]))
    torch.testing.assert_close(hilbert_transport(padded, target), hilbert_transport(source, target))


@pytest.mark.parametrize(("d", "n_bits"), [(1, 6), (2, 1), (2, 5), (3, 3), (4, 2), (6, 2)])
def test_a_hilbert_curve_visits_every_cell_once_by_steps_to_a_neighbour(d, n_bits):
    cells = np.stack(np.meshgrid(*[np.arange(2**n_bits)] * d, indexing="ij"), axis=-1).reshape(-1, d)
    order = np.argsort(hilbert_index(cells, n_bits))
    np.testing.assert_array_equal(np.sort(hilbert_index(cells, n_bits)), np.arange(len(cells)))
    assert (np.abs(np.diff(cells[order], axis=0)).sum(axis=1) == 1).all()


def test_more_cells_refine_the_same_curve():
    cells = np.random.default_rng(0).integers(0, 64, (100, 3))
    coarse, fine = hilbert_index(cells >> 2, 4), hilbert_index(cells, 6)
    np.testing.assert_array_equal(fine >> 6, coarse)


def test_more_curves_are_a_mean_of_single_ones():
    source, target = pair(40, 40)
    each_turn = [float(hilbert_transport(source, target, 1, seed=seed)) for seed in range(5)]
    assert len({round(value, 9) for value in each_turn}) == 5
    assert min(each_turn) < float(hilbert_transport(source, target, 50)) < 1.5 * max(each_turn)


# Arguments.


def test_a_batch_has_a_direction_and_a_plan_of_its_own():
    points = torch.stack([problems.cloud(0, 9, 3).points] * 2)
    moved = points + torch.tensor([[[3.0, 0, 0]], [[0, 4.0, 0]]])
    found = max_sliced_direction(points, moved, 20).abs()
    torch.testing.assert_close(found, torch.eye(3, dtype=torch.float64)[:2], rtol=0, atol=1e-6)
    assert min_sliced_transport(points, moved, LINES).tolist() == pytest.approx([9, 16])
    assert float(max_sliced_wasserstein(points, moved, LINES, reduction="mean")) == pytest.approx(12.5)


def test_doors(unchecked):
    source, target = pair()
    refuses("n_steps is -1", max_sliced_wasserstein, source, target, LINES, 2, -1)
    refuses("n_steps is 1.5", max_sliced_direction, source, target, LINES, 2, 1.5)
    refuses("p is 0.5", max_sliced_wasserstein, source, target, LINES, 0.5)
    refuses("power is 0.5; 0 or a finite number >= 1", energy_sliced_wasserstein, source, target, LINES, power=0.5)
    refuses("power is nan", energy_sliced_wasserstein, source, target, LINES, power=float("nan"))
    refuses("temperature is 0", energy_sliced_wasserstein, source, target, LINES, temperature=0)
    refuses("unit rows", energy_sliced_wasserstein, source, target, 2 * LINES)
    refuses("control is 'upside'", controlled_sliced_wasserstein, source, target, LINES, control="upside")
    refuses("which is for p = 2", controlled_sliced_wasserstein, source, target, LINES, 1, "lower")
    refuses("11 directions are too few for 5", controlled_sliced_wasserstein, source, target, LINES[:11])
    refuses("3 directions are too few for 1", controlled_sliced_wasserstein, source, target, LINES[:3], 2, "lower")
    refuses("p is 0.5", min_sliced_transport, source, target, LINES, 0.5)
    refuses("a batch of 2 pairs", min_sliced_plan, [source, source], target, LINES)
    refuses("n_curves is 0", hilbert_transport, source, target, 0)
    refuses("p is 0.5", hilbert_transport, source, target, 1, 0.5)
    refuses("R\\^60; at most R\\^52", hilbert_transport, problems.cloud(0, 3, 60), problems.cloud(1, 3, 60))
    refuses("beside directions of shape", energy_sliced_wasserstein, source, target, LINES, seed=1)
    large = DiscreteMeasure(source.points.float() * 1e25), DiscreteMeasure(target.points.float())
    for name in ("energy", "controlled", "lifted", "max"):
        refuses("exceeds the range of torch.float32", LOSSES[name], *large, directions=LINES.float())
