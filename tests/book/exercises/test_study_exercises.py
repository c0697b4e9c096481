"""The exercises of chapter 37: independent solutions pass, and each usual mistake gets its own hint."""

import math

import numpy as np
import pytest
from scipy import stats

from meshot_book.exercises import check
from meshot_book.statistics import intraclass_correlation


def by_the_library(first, second):
    return intraclass_correlation(np.stack([first, second], axis=1)).value


def by_counting(effect, reliability, power):
    """The smallest n with the power, by the normal distribution of the difference."""
    n = 1
    while stats.norm.cdf(effect * math.sqrt(reliability * n / 2) - stats.norm.isf(0.025)) < power:
        n += 1
    return n


def by_the_turning_point(reliability, person_cost, visit_cost):
    """a / k + b k is smaller at k than at k + 1 if a / b < k (k + 1)."""
    ratio = person_cost * (1 - reliability) / (visit_cost * reliability)
    return next(k for k in range(1, 1000) if ratio <= k * (k + 1))


SOLUTIONS = {
    "pair_reliability": by_the_library,
    "group_size": by_counting,
    "best_visits": by_the_turning_point,
}


@pytest.mark.parametrize("name", SOLUTIONS)
def test_independent_solutions_pass(capsys, name):
    getattr(check, name)(SOLUTIONS[name])
    assert capsys.readouterr().out.startswith("✓")


def squares(first, second):
    return 2 * np.var((first + second) / 2, ddof=1), np.mean((first - second) ** 2) / 2


def share(between, within):
    return (between - within) / (between + within)


def n_by_formula(effect, seen, power, sides=2):
    return 2 * (stats.norm.isf(0.05 / sides) - stats.norm.isf(power)) ** 2 / (effect**2 * seen)


def turning(reliability, person_cost, visit_cost):
    return (person_cost / visit_cost * (1 / reliability - 1)) ** 0.5


def smallest(cost):
    return 1 + int(np.argmin([cost(k) for k in range(1, 400)]))


def spread(reliability, k):
    return reliability + (1 - reliability) / k


MISTAKES = {
    "pair_reliability": {
        "does not see a shift": lambda a, b: stats.pearsonr(a, b).statistic,
        "contains the error too": lambda a, b: squares(a, b)[0] / sum(squares(a, b)),
        "half the mean of the squared differences": lambda a, b: share(squares(a, b)[0], np.mean((a - b) ** 2)),
        "twice the variance of the people's means": lambda a, b: share(np.var((a + b) / 2, ddof=1), squares(a, b)[1]),
        "number of people less one": lambda a, b: share(2 * np.var((a + b) / 2), squares(a, b)[1]),
        "do not subtract the mean difference": lambda a, b: share(squares(a, b)[0], np.var(b - a, ddof=1) / 2),
    },
    "group_size": {
        "the reliability is not used": lambda d, r, p: math.ceil(n_by_formula(d, 1, p)),
        "not fewer": lambda d, r, p: math.ceil(n_by_formula(d, 1 / r, p)),
        "its square is ρ times": lambda d, r, p: math.ceil(n_by_formula(d, r * r, p)),
        "without a root": lambda d, r, p: math.ceil(n_by_formula(d, math.sqrt(r), p)),
        "twice the variance of one mean": lambda d, r, p: math.ceil(n_by_formula(d, r, p) / 2),
        "2.5 % on each side": lambda d, r, p: math.ceil(n_by_formula(d, r, p, sides=1)),
        "the power is not used": lambda d, r, p: math.ceil(n_by_formula(d, r, 0.5)),
        "round up": lambda d, r, p: int(n_by_formula(d, r, p)),
        "people are whole": n_by_formula,
    },
    "best_visits": {
        "a person costs something too": lambda *_: 1,
        "not symmetric": lambda *given: max(1, round(turning(*given))),
        "the smaller one may be cheaper": lambda *given: max(1, math.ceil(turning(*given))),
        "the larger one may be cheaper": lambda *given: max(1, int(turning(*given))),
        "needs fewer visits, not more": lambda r, a, b: by_the_turning_point(1 - r, a, b),
        "the two costs are exchanged": lambda r, a, b: smallest(lambda k: (b + k * a) * spread(r, k)),
        "a whole number of visits": turning,
    },
}


@pytest.mark.parametrize(
    ("name", "words"), [(name, words) for name, mistakes in MISTAKES.items() for words in mistakes]
)
def test_each_mistake_has_its_hint(hinted, name, words):
    hinted(getattr(check, name), MISTAKES[name][words], words)
