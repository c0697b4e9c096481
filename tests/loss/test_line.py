"""The plan on a line: a coupling, as cheap as linear programming makes it, for every exponent at once."""

import numpy as np
import ot
import pytest
import torch
from hypothesis import given, settings, strategies as st

from meshot.loss.sliced import quantile_cost
from meshot_book.lines import monotone_plan
from refusals import refuses


def drawn(seed, n):
    """Points and weights on a line with ties and, where there is more than one point, weights of zero."""
    generator = np.random.default_rng(seed)
    points = generator.normal(size=n).round(int(generator.integers(0, 6)))
    weights = generator.random(n) * (generator.random(n) > 0.3)
    weights[generator.integers(n)] += 0.1
    return torch.from_numpy(points), torch.from_numpy(weights / weights.sum())


def marginals(plan, n, m):
    zeros = (torch.zeros(k, dtype=torch.float64) for k in (n, m))
    return [z.index_add(0, i, plan.masses) for z, i in zip(zeros, (plan.source, plan.target))]


@settings(max_examples=150)
@given(seed=st.integers(0, 10**6), n=st.integers(1, 12), m=st.integers(1, 12), p=st.sampled_from([1.0, 1.5, 2.0, 4.0]))
def test_plan_is_a_coupling_of_least_cost(seed, n, m, p):
    (x, a), (y, b) = drawn([seed, 0], n), drawn([seed, 1], m)
    plan = monotone_plan(x, a, y, b)
    left, right = marginals(plan, n, m)
    torch.testing.assert_close(left, a, rtol=0, atol=1e-12)
    torch.testing.assert_close(right, b, rtol=0, atol=1e-12)
    assert len(plan.masses) <= n + m - 1
    assert (plan.masses > 0).all()
    cost = float((plan.masses * (x[plan.source] - y[plan.target]).abs() ** p).sum())
    program = ot.emd2(a.numpy(), b.numpy(), np.abs(x.numpy()[:, None] - y.numpy()) ** p)
    assert cost == pytest.approx(program, rel=1e-9, abs=1e-12)
    assert cost == pytest.approx(float(quantile_cost(x[None], a, y[None], b, p)), rel=1e-9, abs=1e-12)


def test_cells_in_order_by_hand():
    x, a = torch.tensor([3.0, 1.0]).double(), torch.tensor([0.25, 0.75]).double()
    y, b = torch.tensor([0.0, 9.0, 5.0]).double(), torch.tensor([0.5, 0.125, 0.375]).double()
    plan = monotone_plan(x, a, y, b)
    assert plan.source.tolist() == [1, 1, 0, 0]
    assert plan.target.tolist() == [0, 2, 2, 1]
    assert plan.masses.tolist() == [0.5, 0.25, 0.125, 0.125]


def test_cost_of_the_plan_has_the_gradient_of_the_loss_up_to_a_constant():
    generator = np.random.default_rng(3)
    x, y = (torch.from_numpy(generator.normal(size=n)) for n in (6, 9))
    a, b = (torch.from_numpy(generator.dirichlet(np.ones(n))).requires_grad_() for n in (6, 9))
    plan = monotone_plan(x, a, y, b)
    (plan.masses * (x[plan.source] - y[plan.target]) ** 2).sum().backward()
    ours = [w.grad - w.grad.mean() for w in (a, b)]
    a.grad = b.grad = None
    quantile_cost(x[None], a, y[None], b).sum().backward()
    for found, w in zip(ours, (a, b)):
        torch.testing.assert_close(found, w.grad - w.grad.mean(), rtol=0, atol=1e-10)


def test_roundoff_in_the_weights_leads_nowhere():
    # Ten tenths sum to a little less than one; the last points weigh nothing.
    a = torch.tensor([0.1] * 10 + [0.0] * 3, dtype=torch.float64)
    plan = monotone_plan(torch.arange(13.0).double(), a, torch.zeros(1).double(), torch.ones(1).double())
    assert set(plan.source.tolist()) <= set(range(10))
    assert float(plan.masses.sum()) == 1


@pytest.mark.parametrize(
    ("x", "a", "message"),
    [
        (torch.zeros(2, 1), torch.ones(2) / 2, r"\(n,\) is needed"),
        (torch.zeros(0), torch.zeros(0), "at least one"),
        (torch.zeros(2), torch.ones(2), "sum to 2"),
        (torch.tensor([0.0, torch.nan]), torch.ones(2) / 2, "NaN"),
    ],
)
def test_bad_input_is_refused(unchecked, x, a, message):
    refuses(message, monotone_plan, x, a, torch.zeros(1), torch.ones(1))
