"""The exercises of chapter 02: truths from POT and NumPy, and a different hint for each usual mistake."""

import numpy as np
import ot
import pytest
import torch

from meshot_book.exercises import check
from meshot_book.lines import monotone_plan


def numpy_quantiles(x, a, z):
    """By counting: no sorting of masses, no searching."""
    below = [float(a[x <= place].sum()) for place in x]
    return torch.stack([min(p for p, m in zip(x, below) if m >= level - 1e-12) for level in z.tolist()])


def pot_cost(x, a, y, b, p):
    return ot.emd2_1d(x.numpy(), y.numpy(), a.numpy(), b.numpy(), metric="minkowski", p=p)


def pot_potential(x, a, y, b, p):
    """The dual variables of the linear program."""
    _, log = ot.emd(a.numpy(), b.numpy(), np.abs(x.numpy()[:, None] - y.numpy()) ** p, log=True)
    dual = torch.from_numpy(log["u"])
    return dual - a @ dual


@pytest.mark.parametrize(
    ("checker", "function"),
    [
        (check.quantiles, numpy_quantiles),
        (check.transport_cost, pot_cost),
        (check.weight_gradient, pot_potential),
    ],
)
def test_independent_solutions_pass(capsys, checker, function):
    checker(function)
    assert capsys.readouterr().out.startswith("✓")


def stairs(x, a, z, right=False):
    return x[torch.searchsorted(a.cumsum(0), z, right=right).clamp(max=len(x) - 1)]


def by_order(x, a):
    return x.sort().values, a[x.argsort()]


def gaps(x, a, y, b):
    plan = monotone_plan(x, a, y, b)
    return x[plan.source] - y[plan.target], plan


def own_cost(x, a, y, b, p):
    gap, plan = gaps(x, a, y, b)
    paid = torch.zeros_like(x).index_add(0, plan.source, plan.masses * gap.abs() ** p) / a
    return paid - a @ paid


QUANTILES = {
    "the points are not sorted": stairs,
    "keep its own mass": lambda x, a, z: stairs(x.sort().values, a, z),
    "counts points": lambda x, a, z: x.sort().values[torch.ceil(z * len(x)).long() - 1],
    "≥, not >": lambda x, a, z: stairs(*by_order(x, a), z, right=True),
    "the quantile function is piecewise constant": lambda x, a, z: torch.quantile(x, z),
}
COST = {
    "leave out the root": lambda *c: pot_cost(*c) ** (1 / c[4]),
    "whatever p is": lambda *c: pot_cost(*c[:4], 2),
    "cancel": lambda x, a, y, b, p: abs(float(a @ x - b @ y)) ** p,
    "the source is sorted without": lambda *c: pot_cost(c[0].sort().values, *c[1:]),
    "both sides are sorted without": lambda *c: pot_cost(c[0].sort().values, c[1], c[2].sort().values, *c[3:]),
    "ranks are paired": lambda x, a, y, b, p: sum(
        abs(i - j) ** p / min(len(x), len(y)) for i, j in zip(sorted(x.tolist()), sorted(y.tolist()))
    ),
    "every source point sends mass to every target point": lambda x, a, y, b, p: (
        torch.outer(a, b) * (x[:, None] - y).abs() ** p
    ).sum(),
}
GRADIENT = {
    "the sign is reversed": lambda *c: -pot_potential(*c),
    "subtract the mean under": lambda *c: pot_potential(*c) - pot_potential(*c)[c[0].argmin()],
    "not the plain one": lambda *c: pot_potential(*c) - pot_potential(*c).mean(),
    "order of the sorted points": lambda *c: pot_potential(*c)[c[0].argsort()],
    "this is the cost of each point alone": own_cost,
}


@pytest.mark.parametrize(
    ("checker", "words", "function"),
    [
        (getattr(check, name), words, function)
        for name, mistakes in (("quantiles", QUANTILES), ("transport_cost", COST), ("weight_gradient", GRADIENT))
        for words, function in mistakes.items()
    ],
)
def test_each_mistake_has_its_hint(hinted, checker, words, function):
    hinted(checker, function, words)
