"""Standard errors of sliced Wasserstein losses that draw finitely many directions, or windows."""

import dataclasses
import math

import torch
from scipy import stats

from meshot.errors import require_choice, require_positive_integer
from meshot.loss.directions import orthogonal_directions, quasi_directions, random_directions
from meshot.loss.sliced import slice_costs
from meshot.loss.windowed import drawn_windows, window_costs
from meshot.measure import MeasureLike, as_measures, as_point_measures
from meshot.rng import Generator, numpy_generator


@dataclasses.dataclass(frozen=True, eq=False)
class SlicedEstimate:
    """An estimate of SW_p^p over all directions, or windows, with its standard error.

    Parameters
    ----------
    value : float
        The mean over what was drawn: unbiased for the mean over all directions, or windows, in (units of the points)^p.
        (The p-th root of SW_p^p is biased downwards; the relative bias is about ``(p − 1)/(2 p²) · relative_error²``.)
    standard_error : float
        The root of an unbiased estimate of the variance of ``value``.
    n_directions : int
        The total number of directions, in all windows.
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

        For quasi-random sets, whose error decreases faster, the result is an upper estimate. Windows with n directions
        each: the number of windows is this number, divided by n.

        Raises
        ------
        ValueError
            If ``relative_error`` is not above zero.
        """
        if not relative_error > 0:
            raise ValueError(f"relative_error is {relative_error!r}; a share above 0 is needed, such as 0.01 for 1 %")
        return max(1, math.ceil(self.n_directions * (self.relative_error / relative_error) ** 2))

    @property
    def relative_error(self) -> float:
        """Standard error divided by value; zero if both are zero."""
        return self.standard_error / self.value if self.value else 0.0

    def interval(self, level: float = 0.95) -> tuple[float, float]:
        """The confidence interval of the mean over all draws, by Student's t distribution, cut off at zero.

        Raises
        ------
        ValueError
            If ``level`` is not between 0 and 1.
        """
        if not 0 < level < 1:
            raise ValueError(f"level is {level!r}; a share between 0 and 1 is needed, such as 0.95")
        half = float(stats.t.ppf((1 + level) / 2, self.n_replicates - 1)) * self.standard_error
        return max(self.value - half, 0.0), self.value + half


SAMPLINGS = ("random", "orthogonal", "quasi")


def sliced_wasserstein_estimate(
    source: MeasureLike,
    target: MeasureLike,
    n_directions: int,
    generator: Generator,
    p: float = 2,
    sampling: str = "random",
    n_replicates: int = 10,
) -> SlicedEstimate:
    """Estimate SW_p^p over all directions without bias, with a standard error for the choice of L.

    Parameters
    ----------
    source, target : measure, Mesh, Contour, array or tensor
        As for :func:`meshot.sliced_wasserstein`.
    n_directions : int
        The number L of directions, rounded up to whole blocks if the sampling has blocks.
    generator : numpy.random.Generator, torch.Generator or int
        Random number generator; an integer is a seed.
    p : float
        The exponent.
    sampling : str
        ``"random"``: independent directions, each a replicate. ``"orthogonal"``: blocks of d orthogonal directions,
        each block a replicate. ``"quasi"``: ``n_replicates`` sets of :func:`meshot.quasi_directions`, each with its own
        rotation.
    n_replicates : int
        Number of quasi-random sets, at least two; not used otherwise. With more sets the standard error is more
        accurate and the value slightly less, since each set is smaller.

    Raises
    ------
    ValueError
        If the sampling is unknown or gives fewer than two replicates, from which no standard error can be computed;
        otherwise as :func:`meshot.sliced_wasserstein`.

    Notes
    -----
    Values only, without gradients. The standard error concerns the directions. It does not include the error of sampled
    points on a surface, which continuous measures do not have.

    Examples
    --------
    >>> import numpy as np, meshot
    >>> points = np.random.default_rng(0).normal(size=(50, 3))
    >>> estimate = meshot.sliced_wasserstein_estimate(points, points + 1, 300, generator=0)
    >>> low, high = estimate.interval()
    >>> low < 1 < high  # a translation by t costs |t|²/d
    True
    """
    require_choice(sampling, "sampling", SAMPLINGS)
    require_positive_integer(n_directions, "n_directions")
    require_positive_integer(n_replicates, "n_replicates")
    source, target = as_measures(source, target)
    d = source.places.shape[1]
    block = {"random": 1, "orthogonal": d, "quasi": math.ceil(n_directions / n_replicates)}[sampling]
    count = n_replicates if sampling == "quasi" else math.ceil(n_directions / block)
    if count < 2:
        raise ValueError(
            f"{n_directions} directions make {count} replicate of {sampling} sampling in R^{d}; an error bar needs at "
            "least two: take more directions, or, of quasi-random sets, more n_replicates"
        )
    draw = numpy_generator(generator)
    if sampling == "random":
        directions = random_directions(count, d, draw)
    elif sampling == "orthogonal":
        directions = orthogonal_directions(count * block, d, draw)
    else:
        seeds = draw.integers(2**31, size=count)
        directions = torch.cat([quasi_directions(block, d, int(seed)) for seed in seeds])
    with torch.no_grad():
        costs = slice_costs(source, target, directions.to(source.places), p)
    means = costs.double().cpu().view(count, block).mean(dim=1).numpy()
    return SlicedEstimate(float(means.mean()), float(means.std(ddof=1)) / math.sqrt(count), count * block, count)


def windowed_sliced_wasserstein_estimate(
    source: MeasureLike,
    target: MeasureLike,
    n_windows: int,
    radius: float,
    generator: Generator,
    n_directions: int = 16,
    p: float = 2,
) -> SlicedEstimate:
    """Estimate the windowed loss over all windows without bias, with a standard error for the choice of K.

    Windows are drawn as in a training: centres at positions of the target, by mass, each with random directions of its
    own. They are therefore independent replicates.

    Parameters
    ----------
    source, target : measure of points, Mesh, Contour, array or tensor
        As for :func:`meshot.windowed_sliced_wasserstein`.
    n_windows : int
        The number K of windows.
    radius : float
        Standard deviation of the windows, in the units of the points.
    generator : numpy.random.Generator, torch.Generator or int
        Random number generator; an integer is a seed.
    n_directions : int
        Directions in each window. Few of them suffice: the mean over windows is a mean over their directions, too.
    p : float
        The exponent.

    Raises
    ------
    ValueError
        If fewer than two windows hold mass of both measures, from which no standard error can be computed; otherwise as
        :func:`meshot.windowed_sliced_wasserstein`.

    Notes
    -----
    Values only, without gradients. The standard error concerns the draw of windows and directions.

    Examples
    --------
    >>> import numpy as np
    >>> from meshot.loss import windowed_sliced_wasserstein_estimate
    >>> points = np.random.default_rng(0).uniform(size=(500, 3))
    >>> estimate = windowed_sliced_wasserstein_estimate(points, points + 0.01, 40, 0.2, generator=0)
    >>> estimate.relative_error < 0.2
    True
    """
    require_positive_integer(n_windows, "n_windows")
    require_positive_integer(n_directions, "n_directions")
    source, target = as_point_measures(source, target)
    windows = drawn_windows(target, n_windows, n_directions, generator)
    costs = window_costs(source, target, windows, radius, p)
    count = len(costs)
    if count < 2:
        raise ValueError(
            f"{count} of {n_windows} windows holds mass of both measures; an error bar needs at least two: draw more "
            "windows, or take a larger radius"
        )
    deviation = float(costs.std(ddof=1)) / math.sqrt(count)
    return SlicedEstimate(float(costs.mean()), deviation, n_windows * n_directions, count)
