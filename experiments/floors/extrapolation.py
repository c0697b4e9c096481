"""Extrapolation from feasible samples to a larger number of points: two models, each with its 95 % interval."""

import math
from collections.abc import Callable

import numpy as np

from meshot.statistics import percentile_interval
from meshot_book.statistics import fitted_slope

Groups = dict[int, list[float]]


def power_law(groups: Groups, target_m: int) -> float:
    """The value at ``target_m`` of a line fitted to the logarithms of the means, weighted by repetitions."""
    sizes = np.log(list(groups))
    heights = np.log([np.mean(values) for values in groups.values()])
    slope, offset = np.polyfit(sizes, heights, 1, w=np.sqrt([len(values) for values in groups.values()]))
    return float(np.exp(offset + slope * math.log(target_m)))


def matching_law(area: float) -> Callable[[Groups, int], float]:
    """W₂² = A (log m + c) / (2π m): the asymptotics of random matching on a surface of area A, with fitted c.

    Ambrosio, Stra and Trevisan (2019) proved the constant for the square; Ambrosio and Glaudo (2019) for any closed
    surface with geodesic distances. c absorbs the remaining terms. For small m, straight lines are shorter than paths
    on a folded surface, so that c grows with m until the spacing of points is smaller than the folds.
    """

    def law(groups: Groups, target_m: int) -> float:
        offsets = [
            2 * math.pi * m / area * float(np.mean(np.square(values))) - math.log(m) for m, values in groups.items()
        ]
        c = np.average(offsets, weights=[len(values) for values in groups.values()])
        return math.sqrt(area * (math.log(target_m) + c) / (2 * math.pi * target_m))

    return law


def with_interval(law: Callable[[Groups, int], float], groups: Groups, target_m: int, n_draws: int, seed: int) -> dict:
    """The prediction of a model at ``target_m``, and the central 95 % of its predictions for resampled repetitions."""
    generator = np.random.default_rng(seed)
    drawn = []
    for _ in range(n_draws):
        again = {m: generator.choice(values, len(values)) for m, values in groups.items()}
        drawn.append(law(again, target_m))
    low, high = percentile_interval(drawn)
    return {"value": law(groups, target_m), "low": float(low), "high": float(high)}


def ratios_of(groups: Groups, exact: dict[tuple[int, int], float]) -> Groups:
    """Each value over exact W₂ of the same samples. The ratio varies less than either, since both share the draw."""
    return {m: [value / exact[m, seed] for seed, value in enumerate(values)] for m, values in groups.items()}


def slope_of(groups: Groups, n_draws: int, seed: int) -> dict:
    """The exponent of the mean over the number of points, with its interval."""
    slope, low, high = fitted_slope(list(groups), list(groups.values()), "mean", n_draws, seed)
    return {"value": slope, "low": low, "high": high}
