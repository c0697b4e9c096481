"""Slopes of errors on logarithmic axes, with intervals that come from the repetitions."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy import stats

from meshot.rng import Generator, numpy_generator
from meshot.statistics.intervals import LEVEL, percentile_interval

Values = Sequence[float] | np.ndarray
Rows = Sequence[Values] | np.ndarray

#: From repetitions to one number: E|error|, as in the theorem, or the root of E error².
STATISTICS = ("mean", "rms")


class Slope(NamedTuple):
    """An exponent, and the ends of its 95 % interval: unpacks as ``slope, low, high``."""

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

    At every x the repetitions become one number, and a straight line is laid through the logarithms, each weighted by
    its number of repetitions. The interval is that of the percentile bootstrap: repetitions are drawn anew at
    every x, and the line is laid again. It tells how far chance moves the fit, and not whether a line is the right
    curve. With a single error at every x there is nothing to draw: then the interval is Student's, from what the
    line leaves over.

    Parameters
    ----------
    x : sequence of float
        Sizes, positive, at least two of them different (three where errors are single).
    errors : sequence of sequences
        For each x its repetitions, signed or not, as many as there are.
    statistic : str
        "mean" for the mean absolute error, "rms" for the root of the mean square.
    n_draws : int
        How often the repetitions are drawn anew.
    generator : numpy.random.Generator, torch.Generator or int
        Of these draws.

    Raises
    ------
    ValueError
        If the lengths do not fit, an x or a mean error is not positive, or the statistic is unknown.
    """
    rows = [np.abs(np.asarray(row, dtype=np.float64)).reshape(-1) for row in errors]
    _require_fit(x, rows, statistic)
    logs = np.log(np.asarray(x, dtype=np.float64))
    counts = np.array([len(row) for row in rows], dtype=np.float64)
    weights = counts * (logs - np.average(logs, weights=counts))
    weights /= weights @ logs  # slope = weights @ log(error): a weighted least-squares line
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
    """One number for every row of repetitions: the mean absolute error, or the root of the mean square ("rms")."""
    if statistic == "rms":
        return np.array([np.sqrt(np.mean(np.square(row))) for row in errors])
    return np.array([np.mean(np.abs(row)) for row in errors])


def _students(logs: np.ndarray, heights: np.ndarray, slope: float) -> Slope:
    half = stats.t.ppf((1 + LEVEL) / 2, len(logs) - 2) * stats.linregress(logs, heights).stderr
    return Slope(slope, float(slope - half), float(slope + half))


def _require_fit(x: Values, rows: list[np.ndarray], statistic: str) -> None:
    if statistic not in STATISTICS:
        raise ValueError(f"statistic is {statistic!r}; one of {', '.join(map(repr, STATISTICS))} is needed")
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
