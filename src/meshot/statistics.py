"""Statistics of repeated measurements: intervals for means and other statistics, and scores that mark outliers.

All intervals are 95 % confidence intervals: Student's for means of a few seeds, the percentile bootstrap otherwise.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy import stats

from meshot.rng import Generator, numpy_generator
from meshot.types import Array

__all__ = [
    "LEVEL",
    "OUTLIER_SCORE",
    "Interval",
    "bootstrap_interval",
    "mean_interval",
    "paired_interval",
    "percentile_interval",
    "robust_scores",
]

Values = Sequence[float] | Array

#: The confidence level of all intervals.
LEVEL = 0.95


class Interval(NamedTuple):
    """A statistic and the ends of its 95 % interval. It unpacks as ``value, low, high``."""

    value: float
    low: float
    high: float


def mean_interval(values: Values) -> Interval:
    """The mean of independent values, with Student's 95 % interval: mean ± t·s/√n.

    Exact for normally distributed values. If all values are equal, both ends are the mean.

    Raises
    ------
    ValueError
        If there are fewer than two values, or one is not finite.
    """
    numbers = _numbers(values)
    # SciPy's interval of a t-test is NaN if all values are equal.
    half = float(stats.t.ppf((1 + LEVEL) / 2, len(numbers) - 1) * stats.sem(numbers))
    mean = float(numbers.mean())
    return Interval(mean, mean - half, mean + half)


def paired_interval(first: Values, second: Values) -> Interval:
    """The mean of ``first − second`` over pairs, with Student's 95 % interval, as in a paired t-test.

    Parameters
    ----------
    first, second : sequence of float
        Values of two arms with the same seeds or the same subjects, in the same order.

    Raises
    ------
    ValueError
        If the lengths differ, there are fewer than two pairs, or a value is not finite.
    """
    if len(first) != len(second):
        raise ValueError(f"there are {len(first)} and {len(second)} values; pairs are needed, one of each for a seed")
    return mean_interval(np.asarray(first, dtype=np.float64) - np.asarray(second, dtype=np.float64))


def bootstrap_interval(
    *samples: Values,
    statistic: Callable[..., Array] = np.mean,
    paired: bool = False,
    n_draws: int = 2000,
    generator: Generator = 0,
) -> Interval:
    """A statistic of one or more samples, with its 95 % interval by the percentile bootstrap.

    Each sample is resampled with replacement ``n_draws`` times. The interval is the central 95 % of the statistics of
    the resampled data. It is too narrow for few values: for the mean of eight, by about a fifth.

    Parameters
    ----------
    *samples : sequences of float
        As many as the statistic takes.
    statistic : callable
        Takes the samples as arrays, and ``axis``, the axis of their values.
    paired : bool
        Whether values at the same index belong together and are resampled together.
    n_draws : int
        Number of resamplings.
    generator : numpy.random.Generator, torch.Generator or int
        Random number generator of the resampling; an integer is a seed.

    Raises
    ------
    ValueError
        If a sample has fewer than two values or one that is not finite, or paired samples differ in length.

    References
    ----------
    Efron and Tibshirani, *An Introduction to the Bootstrap*, 1993, chapter 13.
    """
    numbers = [_numbers(sample) for sample in samples]
    if paired and len({len(sample) for sample in numbers}) > 1:
        lengths = ", ".join(str(len(sample)) for sample in numbers)
        raise ValueError(f"paired samples have {lengths} values; equally many are needed, in the same order")
    options = {"method": "percentile", "vectorized": True, "confidence_level": LEVEL}
    drawn = stats.bootstrap(
        numbers, statistic, paired=paired, n_resamples=n_draws, rng=numpy_generator(generator), **options
    )
    found = drawn.confidence_interval
    return Interval(float(statistic(*numbers, axis=-1)), float(found.low), float(found.high))


def percentile_interval(drawn: Values, axis: int = -1) -> Array:
    """The ends of the central 95 % of a statistic over resamplings: its percentile bootstrap interval.

    For resampling that :func:`bootstrap_interval` does not support: samples of several sizes, or several statistics of
    the same draws.

    The draws are along ``axis``. Low and high are along the first axis of the result, which unpacks as ``low, high``.
    """
    tail = (1 - LEVEL) / 2
    return np.quantile(np.asarray(drawn), [tail, 1 - tail], axis=axis)


def _numbers(values: Values) -> Array:
    numbers = np.asarray(values, dtype=np.float64)
    if numbers.ndim != 1 or len(numbers) < 2:
        raise ValueError(f"values have the shape {numbers.shape}; one list of at least two is needed for an interval")
    if not np.isfinite(numbers).all():
        raise ValueError("a value is not finite; leave out repetitions that failed, and say how many")
    return numbers


# Robust scores of single values against the others.

#: A robust score beyond this, in absolute value, marks an outlier (Iglewicz and Hoaglin, 1993).
OUTLIER_SCORE = 3.5
#: The standard deviation of a normal distribution over its median absolute deviation: 1 / Φ⁻¹(3/4).
_DEVIATION_PER_MAD = 1.482602218505602


def robust_scores(values: Array) -> Array:
    """How far each value is from the median, in robust standard deviations: ``(x − median) / (1.4826 MAD)``.

    MAD is the median absolute deviation from the median. For normally distributed values 1.4826 MAD estimates the
    standard deviation; unlike it, MAD does not grow with a few outliers. If more than half of the values are equal,
    MAD is 0: these values then have the score 0, and every other value is infinite, with the sign of its deviation.

    Parameters
    ----------
    values : array
        Of one quantity. NaN stands for a missing value: it has no score and does not count.

    Returns
    -------
    numpy.ndarray
        The scores, NaN where the value is NaN.

    Raises
    ------
    ValueError
        If the values are no list of numbers, or one is infinite.

    References
    ----------
    Iglewicz and Hoaglin, *How to Detect and Handle Outliers*, 1993.
    """
    numbers = np.asarray(values, dtype=np.float64)
    if numbers.ndim != 1 or np.isinf(numbers).any():
        raise ValueError(
            f"values have the shape {numbers.shape} or an infinite entry; one list of finite numbers is needed"
        )
    if np.isnan(numbers).all():
        return numbers.copy()
    deviations = numbers - np.nanmedian(numbers)
    spread = _DEVIATION_PER_MAD * np.nanmedian(np.abs(deviations))
    if spread > 0:
        return deviations / spread
    scores = np.sign(deviations)
    scores[np.abs(scores) == 1] *= np.inf
    return scores
