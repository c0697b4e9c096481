"""How far a sliced Wasserstein loss over finitely many directions is from the mean over all of them."""

import dataclasses
import math

import numpy as np
import torch
from scipy import stats

from meshot.errors import require_positive_integer
from meshot.loss.directions import orthogonal_directions, quasi_directions, random_directions
from meshot.loss.sliced import slice_costs
from meshot.measure import MeasureLike, as_measures
from meshot.rng import Generator, numpy_generator
from meshot.types import Tensor

SAMPLINGS = ("random", "orthogonal", "quasi")


@dataclasses.dataclass(frozen=True, eq=False)
class SlicedEstimate:
    """An estimate of SW_p^p over all directions, with its error bar.

    Parameters
    ----------
    value : float
        The mean over the directions taken: unbiased for SW_p^p, in (units of the points)^p. (Its p-th root is biased
        downward, by about half of ``(p − 1)/p² · relative_error²``, relatively.)
    standard_error : float
        The root of an unbiased estimate of the variance of ``value``.
    n_directions : int
        How many were taken altogether.
    n_replicates : int
        How many independent means the error bar comes from.

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

    @property
    def relative_error(self) -> float:
        """Standard error over value; zero where both are."""
        return self.standard_error / self.value if self.value else 0.0

    def interval(self, level: float = 0.95) -> tuple[float, float]:
        """The confidence interval for SW_p^p over all directions, by Student's t; never below zero.

        Raises
        ------
        ValueError
            If ``level`` is not between zero and one.
        """
        if not 0 < level < 1:
            raise ValueError(f"level is {level!r}; a share between 0 and 1 is needed, such as 0.95")
        half = float(stats.t.ppf((1 + level) / 2, self.n_replicates - 1)) * self.standard_error
        return max(self.value - half, 0.0), self.value + half

    def directions_needed(self, relative_error: float) -> int:
        """How many directions bring the relative standard error down to ``relative_error``, as it falls with L^(−1/2).

        For quasi-random sets, whose error falls faster, this is more than enough.

        Raises
        ------
        ValueError
            If ``relative_error`` is not above zero.
        """
        _require_wanted(relative_error)
        return max(1, math.ceil(self.n_directions * (self.relative_error / relative_error) ** 2))


def sliced_wasserstein_estimate(
    source: MeasureLike,
    target: MeasureLike,
    n_directions: int,
    generator: Generator,
    p: float = 2,
    sampling: str = "random",
    n_replicates: int = 10,
) -> SlicedEstimate:
    """SW_p^p over all directions, estimated without bias, with a standard error that says whether L is enough.

    Parameters
    ----------
    source, target : measure, Mesh, Contour, array or tensor
        As for :func:`meshot.sliced_wasserstein`.
    n_directions : int
        L; rounded up to whole blocks where the sampling has blocks.
    generator : numpy.random.Generator, torch.Generator or int
        Who holds the randomness; an integer is a seed.
    p : float
        The exponent.
    sampling : str
        ``"random"``: independent directions, each one a replicate. ``"orthogonal"``: blocks of d at right angles, each
        block a replicate. ``"quasi"``: ``n_replicates`` sets of :func:`meshot.quasi_directions`, turned one by one.
    n_replicates : int
        Of quasi-random sets, at least two; not used otherwise. More make the error bar surer and the value a little
        worse, since each set is smaller.

    Raises
    ------
    ValueError
        If the sampling is not known, there are fewer than two replicates (one tells nothing of its error), or as
        :func:`meshot.sliced_wasserstein`.

    Notes
    -----
    Values only, without gradients. The error is that of the directions; that of sampling points on a surface comes on
    top, and is absent for continuous measures.

    Examples
    --------
    >>> import numpy as np, meshot
    >>> points = np.random.default_rng(0).normal(size=(50, 3))
    >>> estimate = meshot.sliced_wasserstein_estimate(points, points + 1, 300, generator=0)
    >>> low, high = estimate.interval()
    >>> low < 1 < high  # a translation by t costs |t|²/d
    True
    """
    if sampling not in SAMPLINGS:
        raise ValueError(f"sampling is {sampling!r}; one of {', '.join(map(repr, SAMPLINGS))} is needed")
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
    directions = _replicates(sampling, count, block, d, numpy_generator(generator))
    with torch.no_grad():
        costs = slice_costs(source, target, directions.to(source.places), p)
    means = costs.double().cpu().view(count, block).mean(dim=1).numpy()
    return SlicedEstimate(float(means.mean()), float(means.std(ddof=1)) / math.sqrt(count), count * block, count)


def _replicates(sampling: str, count: int, block: int, d: int, generator: np.random.Generator) -> Tensor:
    if sampling == "random":
        return random_directions(count, d, generator)
    if sampling == "orthogonal":
        return orthogonal_directions(count * block, d, generator)
    seeds = generator.integers(2**31, size=count)
    return torch.cat([quasi_directions(block, d, int(seed)) for seed in seeds])


def translation_spread(d: int, p: float = 2) -> float:
    """The relative standard deviation over random directions of the cost of a translation: what L has to beat.

    Along θ a translation by t costs ``|⟨t, θ⟩|^p``. The standard deviation of this over its mean depends on d and p
    alone; for p = 2 it is ``√(2 (d − 1)/(d + 2))``, below √2 in any dimension. Divided by √L it is the relative
    standard error of L random directions.

    Parameters
    ----------
    d : int
        The dimension of the space.
    p : float
        The exponent, at least 1.

    Raises
    ------
    ValueError
        If ``d`` is not a positive integer, or ``p`` is no finite number >= 1.
    """
    require_positive_integer(d, "d")
    if not 1 <= p < math.inf:
        raise ValueError(f"p is {p!r}; a finite number >= 1 is needed")
    log_ratio = _log_moment(2 * p, d) - 2 * _log_moment(p, d)
    return math.sqrt(max(math.expm1(log_ratio), 0.0))


def _log_moment(q: float, d: int) -> float:
    """log E|θ₁|^q for a uniform direction: Γ(d/2) Γ((q + 1)/2) / (Γ((d + q)/2) √π)."""
    return math.lgamma(d / 2) + math.lgamma((q + 1) / 2) - math.lgamma((d + q) / 2) - math.lgamma(0.5)


def directions_for_translation(relative_error: float, d: int, p: float = 2) -> int:
    """How many random directions bring the relative standard error for a translation down to ``relative_error``.

    A first guess of L before anything is computed; :meth:`meshot.SlicedEstimate.directions_needed` knows the pair at
    hand. In R³ and for p = 2, 1 % takes 8000 directions, 10 % takes 80.

    Raises
    ------
    ValueError
        If ``relative_error`` is not above zero, or as :func:`translation_spread`.
    """
    _require_wanted(relative_error)
    return max(1, math.ceil(round((translation_spread(d, p) / relative_error) ** 2, 9)))


def _require_wanted(relative_error: float) -> None:
    if not relative_error > 0:
        raise ValueError(f"relative_error is {relative_error!r}; a share above 0 is needed, such as 0.01 for 1 %")
