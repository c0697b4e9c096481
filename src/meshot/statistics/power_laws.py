"""Exponents of power laws, fitted to errors on logarithmic axes, with confidence intervals."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy import stats

from meshot.errors import require_choice
from meshot.rng import Generator, numpy_generator
from meshot.statistics.intervals import LEVEL, percentile_interval

Values = Sequence[float] | np.ndarray
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
    x: Values,
    errors: Rows,
    statistic: str = "mean",
    n_draws: int = 2000,
    generator: Generator = 0,
) -> Slope:
    """The exponent s of error ≈ c·x^s, by least squares on logarithms, with its 95 % interval.

    At every x the repetitions are averaged. A straight line is fitted to the logarithms, weighted by the numbers of
    repetitions. The interval is that of the percentile bootstrap: repetitions are resampled at every x, and the line is
    fitted again. It measures the effect of chance on the fit, not whether a power law is the right model. If there is
    only one error at every x, the interval is Student's, from the residuals of the fit.

    Parameters
    ----------
    x : sequence of float
        Sizes, positive, with at least two different values (three if errors are single).
    errors : sequence of sequences
        The repetitions at each x, signed or not, in any number.
    statistic : str
        "mean" for the mean absolute error, "rms" for the root of the mean square.
    n_draws : int
        Number of resamplings.
    generator : numpy.random.Generator, torch.Generator or int
        Random number generator of the resampling; an integer is a seed.

    Raises
    ------
    ValueError
        If the lengths do not match, an x or a mean error is not positive, or the statistic is unknown.
    """
    rows = [np.abs(np.asarray(row, dtype=np.float64)).reshape(-1) for row in errors]
    _require_fit(x, rows, statistic)
    logs = np.log(np.asarray(x, dtype=np.float64))
    counts = np.array([len(row) for row in rows], dtype=np.float64)
    weights = counts * (logs - np.average(logs, weights=counts))
    weights /= weights @ logs  # slope = weights @ log(error): the weighted least-squares fit
    heights = np.log(averages(rows, statistic))
    slope = float(weights @ heights)
    if counts.max() == 1:
        return _students(logs, heights, slope)
    generator = numpy_generator(generator)
    drawn = np.zeros(n_draws)
    for weight, row in zip(weights, rows):
        again = row[generator.integers(len(row), size=(n_draws, len(row)))]
        drawn += weight * np.log(averages(again, statistic))
    low, high = percentile_interval(drawn)
    return Slope(slope, float(low), float(high))


def averages(errors: Rows, statistic: str = "mean") -> np.ndarray:
    """The average of every row of repetitions: the mean absolute error, or the root of the mean square ("rms")."""
    if statistic == "rms":
        return np.array([np.sqrt(np.mean(np.square(row))) for row in errors])
    return np.array([np.mean(np.abs(row)) for row in errors])


def _students(logs: np.ndarray, heights: np.ndarray, slope: float) -> Slope:
    half = stats.t.ppf((1 + LEVEL) / 2, len(logs) - 2) * stats.linregress(logs, heights).stderr
    return Slope(slope, float(slope - half), float(slope + half))


def _require_fit(x: Values, rows: list[np.ndarray], statistic: str) -> None:
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
