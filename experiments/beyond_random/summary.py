"""Root mean square errors over L, their slopes, and the factor saved at a fixed L."""

import numpy as np
from estimators import METHODS

from meshot.statistics import bootstrap_interval
from meshot.types import Array
from meshot_book.statistics import fitted_slope


def summarise(rows: list[dict], config: dict) -> dict:
    """``methods``: for each pair, space and method the relative errors, slope and factor saved, with 95 % intervals."""
    groups: dict[tuple, dict[int, dict[str, list[float]]]] = {}
    for row in rows:
        task = row["task"]
        sizes = groups.setdefault((task["pair"], task["d"]), {})
        sizes.setdefault(task["n_directions"], {}).update(row["found"])
    found = []
    for (pair, d), sizes in groups.items():
        truth = reference(sizes)
        errors = {
            method: {n: np.array(sizes[n][method]) / truth - 1 for n in sizes if method in sizes[n]}
            for method in METHODS
        }
        for method in METHODS:
            common = {"pair": pair, "d": d, "method": method, "truth": _short(truth)}
            found.append(common | _line(errors[method], errors["random"], config))
    return {"methods": found}


def reference(sizes: dict[int, dict[str, list[float]]]) -> float:
    """The reference value for errors: the mean of all estimates of unbiased methods at the largest L.

    The estimates are weighted by the inverse of their variances. Methods that fit coefficients have a bias of O(1/L)
    and are excluded.
    """
    last = {name: np.array(values) for name, values in sizes[max(sizes)].items() if "fitted" not in name}
    weights = {name: len(values) / values.var(ddof=1) for name, values in last.items()}
    return float(sum(weights[name] * values.mean() for name, values in last.items()) / sum(weights.values()))


def _line(errors: dict[int, np.ndarray], random: dict[int, np.ndarray], config: dict) -> dict:
    fitted = [n for n in sorted(errors) if n >= config["fit_from"]]
    slope, low, high = fitted_slope(fitted, [errors[n] for n in fitted], statistic="rms")
    at = config["compare_at"]
    return {
        "sizes": sorted(errors),
        "rmse": [_short(np.sqrt(np.mean(errors[n] ** 2))) for n in sorted(errors)],
        "bias": [_short(errors[n].mean()) for n in sorted(errors)],
        "slope": _short(slope),
        "low": _short(low),
        "high": _short(high),
        "saved": factor_saved(random[at], errors[at]),
    }


def factor_saved(random: np.ndarray, errors: np.ndarray) -> dict:
    """The ratio of two root mean squares, with its 95 % bootstrap interval."""

    def factor(top: Array, bottom: Array, axis: int) -> Array:
        return np.sqrt(np.mean(top**2, axis=axis) / np.mean(bottom**2, axis=axis))

    found = bootstrap_interval(random, errors, statistic=factor)
    return {name: _short(value) for name, value in zip(("factor", "low", "high"), found)}


def _short(value: float) -> float:
    """The value with six significant digits, so that the committed file stays small."""
    return float(f"{value:.6g}")
