"""Robust scores of single values against the others."""

import numpy as np

from meshot.types import Array

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
