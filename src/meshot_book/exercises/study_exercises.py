"""Chapter 37: the reliability of pairs, the size of a group, visits or people."""

import math
from collections.abc import Callable

import numpy as np
from scipy import stats

from meshot.types import Array, Float
from meshot_book.exercises.verdict import Case, Mistake, check_answer

_MOST_VISITS = 500


def pair_reliability(function: object) -> None:
    """Check ``function(first, second)``: the intraclass correlation of two visits of the same people."""
    mistakes = [
        Mistake(
            lambda a, b: np.corrcoef(a, b)[0, 1],
            "Pearson's correlation does not see a shift between the visits; the intraclass correlation does",
        ),
        Mistake(
            lambda a, b: _ratio(*_squares(a, b), minus=0.0),
            "the mean square between people contains the error too: subtract the mean square within people above",
        ),
        Mistake(
            # Half the square between people, or twice the one within people: the ratio is the same.
            lambda a, b: _ratio(_squares(a, b)[0], 2 * _squares(a, b)[1]),
            "the mean square between people is twice the variance of the people's means, and the one within people is "
            "half the mean of the squared differences",
        ),
        Mistake(
            lambda a, b: _ratio(_squares(a, b)[0] * (len(a) - 1) / len(a), _squares(a, b)[1]),
            "divide the squares between people by the number of people less one",
        ),
        Mistake(
            lambda a, b: _ratio(_squares(a, b)[0], np.var(a - b, ddof=1) / 2),
            "do not subtract the mean difference: a shift between the visits is an error too",
        ),
    ]
    generator = np.random.default_rng(0)
    people = generator.normal(size=(40, 1))
    pairs = people + 0.5 * generator.normal(size=(40, 2))
    cases = [
        Case("forty people", (pairs[:, 0], pairs[:, 1])),
        Case("a second visit that is larger by 1", (pairs[:12, 0], pairs[:12, 0] + 1.0)),
        Case("visits without a relation", (pairs[:7, 0], pairs[20:27, 1])),
        Case("three people", (pairs[:3, 0], pairs[:3, 1])),
    ]
    check_answer(function, lambda a, b: _ratio(*_squares(a, b)), cases, mistakes, "pair_reliability")


def _squares(first: Float[Array, " n"], second: Float[Array, " n"]) -> tuple[float, float]:
    return float(np.var(first + second, ddof=1) / 2), float(np.mean((first - second) ** 2) / 2)


def _ratio(between: float, within: float, minus: float = 1.0) -> float:
    return (between - minus * within) / (between + within)


def group_size(function: object) -> None:
    """Check ``function(effect, reliability, power)``: people in each of two groups, by the normal approximation."""
    mistakes = [
        Mistake(lambda d, r, p: math.ceil(_people(d, 1.0, p)), "the reliability is not used"),
        Mistake(
            lambda d, r, p: math.ceil(_people(d, 1 / r, p)), "a lower reliability must need more people, not fewer"
        ),
        Mistake(
            lambda d, r, p: math.ceil(_people(d, r**2, p)),
            "the effect that is seen is √ρ times the true one, so its square is ρ times",
        ),
        Mistake(
            lambda d, r, p: math.ceil(_people(d, r**0.5, p)),
            "the effect is squared in the formula, so the reliability stands there without a root",
        ),
        Mistake(
            lambda d, r, p: math.ceil(_people(d, r, p) / 2),
            "a difference of two means has twice the variance of one mean",
        ),
        Mistake(
            lambda d, r, p: math.ceil(_people(d, r, p, level=0.95)),
            "a two-sided test at 5 % has 2.5 % on each side",
        ),
        Mistake(lambda d, r, p: math.ceil(_people(d, r, 0.5)), "the power is not used"),
        Mistake(lambda d, r, p: math.floor(_people(d, r, p)), "rounded down, the power is too small: round up"),
        Mistake(_people, "people are whole: round up"),
    ]
    cases = [
        Case("a perfect measurement", (0.5, 1.0, 0.8)),
        Case("a reliability of 0.6", (0.5, 0.6, 0.8)),
        Case("a power of 0.95", (1.2, 0.9, 0.95)),
        Case("a small effect", (0.13, 0.45, 0.9)),
    ]
    check_answer(function, lambda d, r, p: math.ceil(_people(d, r, p)), cases, mistakes, "group_size")


def _people(effect: float, reliability: float, power: float, level: float = 0.975) -> float:
    return 2 * (stats.norm.ppf(level) + stats.norm.ppf(power)) ** 2 / (effect**2 * reliability)


def best_visits(function: object) -> None:
    """Check ``function(reliability, person_cost, visit_cost)``: visits of a person at the lowest cost."""
    mistakes = [
        Mistake(
            lambda r, person, visit: 1,
            "a person costs something too: a second visit can be cheaper than another person",
        ),
        Mistake(
            lambda r, person, visit: max(1, round(_turning_point(r, person, visit))),
            "the cost is not symmetric around its minimum: compare the two whole numbers beside it",
        ),
        Mistake(
            lambda r, person, visit: max(1, math.ceil(_turning_point(r, person, visit))),
            "compare the two whole numbers beside the minimum; the smaller one may be cheaper",
        ),
        Mistake(
            lambda r, person, visit: max(1, math.floor(_turning_point(r, person, visit))),
            "compare the two whole numbers beside the minimum; the larger one may be cheaper",
        ),
        Mistake(
            lambda r, person, visit: _best(1 - r, person, visit),
            "a more reliable measurement needs fewer visits, not more: ρ is the share between people",
        ),
        Mistake(
            lambda r, person, visit: _cheapest(lambda k: (visit + k * person) * _more_people(r, k)),
            "the two costs are exchanged",
        ),
        Mistake(_turning_point, "a person has a whole number of visits: compare the two whole numbers beside it"),
    ]
    cases = [
        Case("a reliable measurement", (0.95, 100.0, 100.0)),
        Case("a person who is hard to find", (0.6, 1000.0, 200.0)),
        Case("an unreliable measurement", (0.2, 300.0, 100.0)),
        Case("a cheap visit", (0.5, 1000.0, 9.0)),
        Case("a minimum between one and two", (0.5, 210.0, 100.0)),
        Case("a visit that costs more than finding a person", (0.1, 100.0, 300.0)),
        Case("a minimum just above one", (0.5, 130.0, 100.0)),
    ]
    check_answer(function, _best, cases, mistakes, "best_visits")


def _best(reliability: float, person_cost: float, visit_cost: float) -> int:
    return _cheapest(lambda k: (person_cost + k * visit_cost) * _more_people(reliability, k))


def _more_people(reliability: float, n_visits: int) -> float:
    """One over the reliability of the mean of the visits, by Spearman and Brown."""
    return (1 + (n_visits - 1) * reliability) / (n_visits * reliability)


def _cheapest(cost: Callable[[int], float]) -> int:
    return min(range(1, _MOST_VISITS), key=cost)


def _turning_point(reliability: float, person_cost: float, visit_cost: float) -> float:
    return math.sqrt(person_cost * (1 - reliability) / (visit_cost * reliability))
