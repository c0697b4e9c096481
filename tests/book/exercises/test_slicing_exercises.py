"""The exercises of chapter 03: truths from elsewhere, and a different hint for each usual mistake."""

import math

import numpy as np
import pytest
import torch

from meshot.loss.sliced import sliced_wasserstein
from meshot.measure.discrete import DiscreteMeasure
from meshot_book.exercises import check


def by_library(x, y, u):
    return sliced_wasserstein(DiscreteMeasure(x), DiscreteMeasure(y), u)


def by_statistics(costs, relative_error):
    values = costs.numpy()
    return int(np.ceil(np.var(values, ddof=1) / values.mean() ** 2 / relative_error**2))


def by_swapping(directions):
    """Two sets; for every line, shift both along its perpendicular and swap the copies."""
    first, second = torch.zeros(1, 2, dtype=torch.float64), torch.zeros(1, 2, dtype=torch.float64)
    for number, (x, y) in enumerate(directions.tolist()):
        shift = torch.tensor([-y, x], dtype=torch.float64)
        if number == 0:
            second = second + shift
        else:
            first, second = torch.cat([first, second + shift]), torch.cat([second, first + shift])
    return first, second


@pytest.mark.parametrize(
    ("checker", "function"),
    [(check.sliced_cost, by_library), (check.lines_needed, by_statistics), (check.ghost_pair, by_swapping)],
)
def test_independent_solutions_pass(capsys, checker, function):
    checker(function)
    assert capsys.readouterr().out.startswith("✓")


def gaps(x, y, u):
    return (u @ x.T).sort()[0] - (u @ y.T).sort()[0]


def one_shift(directions):
    x, y = directions[0].tolist()
    return torch.zeros(1, 2), torch.tensor([[-y, x]])


SLICED = {
    "points are paired in their original order": lambda x, y, u: (u @ (x - y).T).square().mean(),
    "axis of the sort": lambda x, y, u: ((x @ u.T).sort()[0] - (y @ u.T).sort()[0]).square().mean(),
    "project first": lambda x, y, u: (u @ (x.sort(0)[0] - y.sort(0)[0]).T).square().mean(),
    "every point carries mass": lambda x, y, u: gaps(x, y, u).square().sum(dim=1).mean(),
    "the loss is their mean": lambda x, y, u: gaps(x, y, u).square().mean(dim=1).sum(),
    "leave the root out": lambda x, y, u: gaps(x, y, u).square().mean().sqrt(),
    "not squared": lambda x, y, u: gaps(x, y, u).abs().mean(),
    "average the squares": lambda x, y, u: gaps(x, y, u).square().mean(dim=1).sqrt().mean(),
}
LINES = {
    "this divides by the number of trial lines as well": lambda c, e: math.ceil(
        c.var() / c.mean() ** 2 / len(c) / e**2
    ),
    "is not squared": lambda c, e: math.ceil(c.std() / c.mean() / e),
    "share of the mean": lambda c, e: math.ceil(c.var() / e**2),
    "number less one": lambda c, e: math.ceil(np.var(c.numpy()) / float(c.mean()) ** 2 / e**2),
    "take no roots": lambda c, e: math.ceil(c.sqrt().var() / c.sqrt().mean() ** 2 / e**2),
    "one line short": lambda c, e: int(c.var() / c.mean() ** 2 / e**2),
    "the number of lines must be whole": lambda c, e: float(c.var() / c.mean() ** 2 / e**2),
}
GHOSTS = {
    "both sets are equal": lambda u: (torch.eye(2), torch.eye(2).flip(0)),
    "equally many": lambda u: (torch.eye(2), torch.zeros(1, 2)),
    "perpendicular to that line": lambda u: (torch.zeros(1, 2), u[:1]),
    "right for one line": one_shift,
    "return first, second": lambda u: torch.zeros(3, 2),
    "points are needed": lambda u: (torch.zeros(2), torch.zeros(2)),
    "returns None": lambda u: None,
}


@pytest.mark.parametrize(
    ("checker", "hint", "function"),
    [
        (checker, hint, function)
        for checker, mistakes in (
            (check.sliced_cost, SLICED),
            (check.lines_needed, LINES),
            (check.ghost_pair, GHOSTS),
        )
        for hint, function in mistakes.items()
    ],
)
def test_each_mistake_has_its_hint(hinted, checker, hint, function):
    hinted(checker, function, hint)
