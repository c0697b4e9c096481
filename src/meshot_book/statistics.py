"""Comparison of two arms of an experiment, for every measure."""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy import stats

from meshot.errors import require_choice
from meshot.rng import Generator, numpy_generator
from meshot.statistics import LEVEL, Interval, Values, paired_interval, percentile_interval
from meshot.types import Array


def arm_differences(
    first: Mapping[str, Values], second: Mapping[str, Values], centre: str = "gap"
) -> dict[str, float | None]:
    """The paired difference, first minus second arm, of every measure, as entries of a table row."""
    if set(first) != set(second):
        odd = ", ".join(sorted(set(first) ^ set(second)))
        raise ValueError(f"{odd}: measured in one arm only; give both arms the same measures")
    found: dict[str, float | None] = {}
    for name, values in first.items():
        if len(values) == len(second[name]) == 1:
            gap, low, high = float(np.subtract(values, second[name])[0]), None, None
        else:
            gap, low, high = paired_interval(values, second[name])
        found |= {f"{name}_{centre}": gap, f"{name}_low": low, f"{name}_high": high}
    return found


# Several differences at once.


def p_of_interval(gap: float, low: float, high: float, n: int) -> float:
    """The two-sided p-value of Student's test of a mean of ``n`` differences, from the mean and its 95 % interval."""
    if n < 2 or not low <= gap <= high:
        raise ValueError(
            f"the mean is {gap} in [{low}, {high}], from {n} differences; a mean inside its interval, from two "
            "differences or more, is needed"
        )
    if low == high:  # all differences are equal
        return float(gap == 0)
    error = (high - low) / 2 / stats.t.ppf((1 + LEVEL) / 2, n - 1)
    return 2 * float(stats.t.sf(abs(gap) / error, n - 1))


def holm_adjusted(p_values: Values) -> Array:
    """The p-values of several tests, adjusted by Holm's rule, in the same order.

    The k-th smallest of n is multiplied by n − k + 1, is at least as large as the one before it, and at most 1. If all
    below 0.05 are taken as decided, the probability of one or more false decisions is at most 5 %.

    References
    ----------
    Holm, *A simple sequentially rejective multiple test procedure*, Scandinavian Journal of Statistics 1979.
    """
    numbers = np.asarray(p_values, dtype=np.float64).reshape(-1)
    if not ((numbers >= 0) & (numbers <= 1)).all():
        raise ValueError(f"the p-values are {numbers.tolist()}; numbers from 0 to 1 are needed")
    order = np.argsort(numbers)
    adjusted = np.empty_like(numbers)
    times = np.arange(len(numbers), 0, -1)
    adjusted[order] = np.minimum(np.maximum.accumulate(times * numbers[order]), 1)
    return adjusted


# Exponents of power laws, fitted to errors on logarithmic axes, with confidence intervals.

Rows = Sequence[Values] | np.ndarray

#: How repetitions are averaged: E|error|, as in the theorem, or the root of E error².
STATISTICS = ("mean", "rms")


class Slope(NamedTuple):
    """An exponent and the ends of its 95 % interval. It unpacks as ``slope, low, high``."""

    slope: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.slope:.3f} [{self.low:.3f}, {self.high:.3f}]"


def fitted_slope(
    x: Values, errors: Rows, statistic: str = "mean", n_draws: int = 2000, generator: Generator = 0
) -> Slope:
    """The exponent s of error ≈ c·x^s, by least squares on logarithms, with its 95 % interval.

    At every x the repetitions are averaged. A straight line is fitted to the logarithms, weighted by the numbers of
    repetitions. The interval is that of the percentile bootstrap: repetitions are resampled at every x, and the line is
    fitted again. It measures the effect of chance on the fit, not whether a power law is the right model. If there is
    only one error at every x, the interval is Student's, from the residuals of the fit.
    """
    rows = [np.abs(np.asarray(row, dtype=np.float64)).reshape(-1) for row in errors]
    require_choice(statistic, "statistic", STATISTICS)
    if len(x) != len(rows):
        raise ValueError(f"there are {len(x)} sizes and {len(rows)} rows of errors; one row for every size is needed")
    if any(len(row) == 0 for row in rows):
        raise ValueError("a size has no errors; at least one repetition is needed at every size")
    needed = 3 if all(len(row) == 1 for row in rows) else 2
    if not all(np.isfinite(size) and size > 0 for size in x) or len(set(map(float, x))) < needed:
        raise ValueError(f"the sizes are {list(x)!r}; at least {needed} different positive numbers are needed")
    if not all(0 < np.mean(row) < np.inf for row in rows):
        raise ValueError(
            "the mean error is zero or not finite at some size, and has no logarithm; leave out sizes at which the "
            "error is exactly zero, or lies below roundoff"
        )
    logs = np.log(np.asarray(x, dtype=np.float64))
    counts = np.array([len(row) for row in rows], dtype=np.float64)
    weights = counts * (logs - np.average(logs, weights=counts))
    weights /= weights @ logs  # slope = weights @ log(error): the weighted least-squares fit
    heights = np.log(averages(rows, statistic))
    slope = float(weights @ heights)
    if counts.max() == 1:
        half = stats.t.ppf((1 + LEVEL) / 2, len(logs) - 2) * stats.linregress(logs, heights).stderr
        return Slope(slope, float(slope - half), float(slope + half))
    generator = numpy_generator(generator)
    drawn = np.zeros(n_draws)
    for weight, row in zip(weights, rows):
        again = row[generator.integers(len(row), size=(n_draws, len(row)))]
        drawn += weight * np.log(averages(again, statistic))
    low, high = percentile_interval(drawn)
    return Slope(slope, float(low), float(high))


def short(value: float | int | np.number) -> float:
    """A number with six significant digits, so that files of results stay small."""
    return float(f"{value:.6g}")


def averages(errors: Rows, statistic: str = "mean") -> np.ndarray:
    """The average of every row of repetitions: the mean absolute error, or the root of the mean square ("rms")."""
    if statistic == "rms":
        return np.array([np.sqrt(np.mean(np.square(row))) for row in errors])
    return np.array([np.mean(np.abs(row)) for row in errors])


# Reliability of a measurement that is repeated on the same people, and what it means for the size of a study.

#: The largest group that is searched for.
_LARGEST_GROUP = 10_000_000


def intraclass_correlation(values: Array | Sequence, groups: Sequence | None = None) -> Interval:
    """The share of the variance that lies between people, with its 95 % interval: ICC(1, 1).

    The model is x = μ + b + e. The deviation b belongs to the person and the error e to the visit; both are normal and
    independent. The intraclass correlation is var(b) / (var(b) + var(e)). It is estimated from the mean squares
    between and within people, and may be negative. The interval is exact under the model: the ratio of the mean
    squares has an F distribution.
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
    """The standard deviation of the error of one visit, with its 95 % interval by the χ² distribution."""
    numbers = _repeated(values)
    n_within = numbers.shape[0] * (numbers.shape[1] - 1)
    total = float(((numbers - numbers.mean(axis=1, keepdims=True)) ** 2).sum())
    tail = (1 + LEVEL) / 2
    parts = (n_within, stats.chi2.ppf(tail, n_within), stats.chi2.ppf(1 - tail, n_within))
    return Interval(*(math.sqrt(total / part) for part in parts))


def power_of_groups(effect: float, n_people: int) -> float:
    """The probability that a two-sided t-test at 5 % finds a difference of two groups of normal values."""
    if not math.isfinite(effect) or n_people < 2:
        raise ValueError(
            f"the effect is {effect} and a group has {n_people} people; a finite number and at least two "
            "people are needed"
        )
    n_free, shift = 2 * n_people - 2, abs(effect) * math.sqrt(n_people / 2)
    limit = stats.t.ppf((1 + LEVEL) / 2, n_free)
    # Far in its tail SciPy's distribution function is NaN instead of the zero that it rounds to.
    wrong_side = np.nan_to_num(stats.nct.cdf(-limit, n_free, shift))
    return float(stats.nct.sf(limit, n_free, shift) + wrong_side)


def people_needed(effect: float, reliability: float = 1.0, power: float = 0.8) -> int:
    """The smallest size of each of two groups with which a two-sided t-test at 5 % has a given power.

    An error of measurement widens both groups. With reliability ρ, the effect that is seen is √ρ times the true one
    (attenuation), and about 1 / ρ times as many people are needed.
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
