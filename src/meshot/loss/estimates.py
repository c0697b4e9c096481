"""Estimates of sliced losses that draw directions or windows: a value with its standard error."""

import dataclasses
import math

from scipy import stats


class _Estimate:
    """What an estimate with a standard error says."""

    value: float
    standard_error: float
    n_replicates: int

    @property
    def relative_error(self) -> float:
        """Standard error divided by value; zero if both are zero."""
        return self.standard_error / self.value if self.value else 0.0

    def interval(self, level: float = 0.95) -> tuple[float, float]:
        """The confidence interval of the mean over all draws, by Student's t distribution, cut off at zero.

        Raises
        ------
        ValueError
            If ``level`` is not between zero and one.
        """
        if not 0 < level < 1:
            raise ValueError(f"level is {level!r}; a share between 0 and 1 is needed, such as 0.95")
        half = float(stats.t.ppf((1 + level) / 2, self.n_replicates - 1)) * self.standard_error
        return max(self.value - half, 0.0), self.value + half

    def _needed(self, n: int, relative_error: float) -> int:
        require_relative_error(relative_error)
        return max(1, math.ceil(n * (self.relative_error / relative_error) ** 2))


@dataclasses.dataclass(frozen=True, eq=False)
class SlicedEstimate(_Estimate):
    """An estimate of SW_p^p over all directions, with its standard error.

    Parameters
    ----------
    value : float
        The mean over the sampled directions: unbiased for SW_p^p, in (units of the points)^p. (Its p-th root is biased
        downwards; the relative bias is about ``(p − 1)/(2 p²) · relative_error²``.)
    standard_error : float
        The root of an unbiased estimate of the variance of ``value``.
    n_directions : int
        The total number of directions.
    n_replicates : int
        The number of independent means from which the standard error is computed.

    Examples
    --------
    >>> import meshot
    >>> estimate = meshot.SlicedEstimate(value=1.0, standard_error=0.125, n_directions=100, n_replicates=10)
    >>> estimate.relative_error
    0.125
    >>> estimate.directions_needed(0.0625)
    400
    """

    value: float
    standard_error: float
    n_directions: int
    n_replicates: int

    def directions_needed(self, relative_error: float) -> int:
        """The number of directions for a relative standard error of ``relative_error``, which decreases as 1/√L.

        For quasi-random sets, whose error decreases faster, the result is an upper estimate.

        Raises
        ------
        ValueError
            If ``relative_error`` is not above zero.
        """
        return self._needed(self.n_directions, relative_error)


@dataclasses.dataclass(frozen=True, eq=False)
class WindowedEstimate(_Estimate):
    """An estimate of the windowed loss over all windows and directions, with its standard error.

    Parameters
    ----------
    value : float
        The mean over the drawn windows that hold mass of both measures: unbiased for the mean over all such windows, in
        (units of the points)^p.
    standard_error : float
        The root of an unbiased estimate of the variance of ``value``.
    n_windows : int
        The number of drawn windows.
    n_replicates : int
        The number of those that hold mass of both measures. Each is a replicate.
    """

    value: float
    standard_error: float
    n_windows: int
    n_replicates: int

    def windows_needed(self, relative_error: float) -> int:
        """The number of windows for a relative standard error of ``relative_error``, which decreases as 1/√K.

        Raises
        ------
        ValueError
            If ``relative_error`` is not above zero.
        """
        return self._needed(self.n_windows, relative_error)


def require_relative_error(relative_error: float) -> None:
    """Check a relative standard error that is asked for.

    Raises
    ------
    ValueError
        If it is not above zero.
    """
    if not relative_error > 0:
        raise ValueError(f"relative_error is {relative_error!r}; a share above 0 is needed, such as 0.01 for 1 %")
