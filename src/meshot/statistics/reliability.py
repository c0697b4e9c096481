"""Reliability of a measurement that is repeated on the same people, and what it means for the size of a study."""

import math
from collections.abc import Sequence

import numpy as np
from scipy import stats

from meshot.statistics.intervals import LEVEL, Interval
from meshot.types import Array

#: The largest group that is searched for.
_LARGEST_GROUP = 10_000_000


def intraclass_correlation(values: Array | Sequence, groups: Sequence | None = None) -> Interval:
    """The share of the variance that lies between people, with its 95 % interval: ICC(1, 1).

    The model is x = μ + b + e. The deviation b belongs to the person and the error e to the visit; both are normal and
    independent. The intraclass correlation is var(b) / (var(b) + var(e)). It is estimated from the mean squares
    between and within people, and may be negative. The interval is exact under the model: the ratio of the mean
    squares has an F distribution.

    Parameters
    ----------
    values : array or nested sequence
        A row for each person and a column for each visit.
    groups : sequence, optional
        The group of each person. Then μ is the mean of the group, so that a difference between groups is no variance
        between people.

    Raises
    ------
    ValueError
        If there are fewer than two visits, a value is not finite, the groups do not fit the rows, there are not more
        people than groups, or all values are equal.

    References
    ----------
    Shrout and Fleiss, *Intraclass correlations: uses in assessing rater reliability*, Psychological Bulletin 1979.
    """
    numbers = _repeated(values)
    between, within, n_between, n_within = _mean_squares(numbers, groups)
    if between == 0 and within == 0:
        raise ValueError("all values are equal; a correlation needs people that differ, or visits that do")
    n_visits, ratio = numbers.shape[1], between / within if within > 0 else math.inf
    tail = (1 + LEVEL) / 2
    ends = (ratio, ratio / stats.f.ppf(tail, n_between, n_within), ratio * stats.f.ppf(tail, n_within, n_between))
    return Interval(*(1.0 if math.isinf(end) else float((end - 1) / (end + n_visits - 1)) for end in ends))


def within_deviation(values: Array | Sequence) -> Interval:
    """The standard deviation of the error of one visit, with its 95 % interval by the χ² distribution.

    Parameters
    ----------
    values : array or nested sequence
        A row for each person and a column for each visit.

    Raises
    ------
    ValueError
        If there are fewer than two visits or no person, or a value is not finite.
    """
    numbers = _repeated(values)
    n_within = numbers.shape[0] * (numbers.shape[1] - 1)
    total = float(((numbers - numbers.mean(axis=1, keepdims=True)) ** 2).sum())
    tail = (1 + LEVEL) / 2
    parts = (n_within, stats.chi2.ppf(tail, n_within), stats.chi2.ppf(1 - tail, n_within))
    return Interval(*(math.sqrt(total / part) for part in parts))


def power_of_groups(effect: float, n_people: int) -> float:
    """The probability that a two-sided t-test at 5 % finds a difference of two groups of normal values.

    Parameters
    ----------
    effect : float
        The difference of the means over the standard deviation within a group.
    n_people : int
        In each group, at least two.

    Raises
    ------
    ValueError
        If the effect is not finite or there are fewer than two people.
    """
    if not math.isfinite(effect) or n_people < 2:
        raise ValueError(
            f"the effect is {effect} and a group has {n_people} people; a finite number and at least two "
            "people are needed"
        )
    n_free, shift = 2 * n_people - 2, abs(effect) * math.sqrt(n_people / 2)
    limit = stats.t.ppf((1 + LEVEL) / 2, n_free)
    return float(stats.nct.sf(limit, n_free, shift) + stats.nct.cdf(-limit, n_free, shift))


def people_needed(effect: float, reliability: float = 1.0, power: float = 0.8) -> int:
    """The smallest size of each of two groups with which a two-sided t-test at 5 % has a given power.

    An error of measurement widens both groups. With reliability ρ, the effect that is seen is √ρ times the true one
    (attenuation), and about 1 / ρ times as many people are needed.

    Parameters
    ----------
    effect : float
        The true difference of the means over the true standard deviation between people.
    reliability : float
        The intraclass correlation of the measurement, above 0 and at most 1.
    power : float
        Between 0.05 and 1.

    Raises
    ------
    ValueError
        If a number is out of range, or ten million people are too few.
    """
    if not (0 < reliability <= 1 and 1 - LEVEL < power < 1):
        raise ValueError(
            f"the reliability is {reliability} and the power {power}; a reliability above 0 and at most 1, and a power "
            "above 0.05 and below 1, are needed"
        )
    seen = abs(effect) * math.sqrt(reliability)
    low, high = 1, 2
    while power_of_groups(seen, high) < power:
        low, high = high, 2 * high
        if high > _LARGEST_GROUP:
            raise ValueError(f"an effect of {seen:.3g} needs more than {_LARGEST_GROUP:,} people in each group")
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if power_of_groups(seen, middle) >= power else (middle, high)
    return high


def _repeated(values: Array | Sequence) -> Array:
    numbers = np.asarray(values, dtype=np.float64)
    if numbers.ndim != 2 or numbers.shape[0] < 1 or numbers.shape[1] < 2:
        raise ValueError(
            f"values have the shape {numbers.shape}; a row for each person and at least two columns, one for each "
            "visit, are needed"
        )
    if not np.isfinite(numbers).all():
        raise ValueError("a value is not finite; leave out people whose visits failed, and say how many")
    return numbers


def _mean_squares(numbers: Array, groups: Sequence | None) -> tuple[float, float, int, int]:
    """Mean squares between and within people, and their degrees of freedom."""
    n_people, n_visits = numbers.shape
    names = [0] * n_people if groups is None else list(groups)
    if len(names) != n_people:
        raise ValueError(
            f"there are {len(names)} groups for {n_people} people; one for each is needed, in the same order"
        )
    members = np.array([[name == other for other in names] for name in names], dtype=np.float64)
    means = numbers.mean(axis=1)
    centred = means - members @ means / members.sum(axis=1)
    n_between, n_within = n_people - len(set(names)), n_people * (n_visits - 1)
    if n_between < 1:
        raise ValueError(f"there are {n_people} people in {len(set(names))} groups; more people are needed")
    within = float(((numbers - means[:, None]) ** 2).sum()) / n_within
    return float(n_visits * (centred**2).sum()) / n_between, within, n_between, n_within
