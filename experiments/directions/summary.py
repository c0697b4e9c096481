"""Root mean square errors with intervals, slopes in L, the factor saved at L = 100, and the ranking of methods."""

import numpy as np

from meshot.statistics import percentile_interval

RANKED_AT = 100


def summarise(found: list[dict], config: dict) -> dict:
    """The summary of ``found``: one row per problem and method with its relative errors (repetitions × counts)."""
    counts = config["n_directions"]
    rows, savings = [], []
    for entry in found:
        squared, rivals = np.square(entry["errors"]), _random_of(found, entry)
        draws = _resampled(len(squared), config["n_resamples"])
        rmse, spread = np.sqrt(squared.mean(axis=0)), np.sqrt(squared[draws].mean(axis=1))  # (resamples, counts)
        slopes = _slopes(counts, spread)
        key = {name: entry[name] for name in ("d", "pair", "p", "method")}
        for i, count in enumerate(counts):
            rows.append(key | {"L": count, "rmse": _short(rmse[i])} | _interval(spread[:, i]))
        rival_spread = np.sqrt(rivals[draws[::-1]].mean(axis=1))
        at = counts.index(RANKED_AT)
        factor = np.sqrt(rivals.mean(axis=0))[at] / rmse[at]
        savings.append(
            key
            | {"slope": _short(_slopes(counts, rmse[None])[0])}
            | {f"slope_{end}": value for end, value in _interval(slopes).items()}
            | {"factor": _short(factor)}
            | {f"factor_{end}": value for end, value in _interval(rival_spread[:, at] / spread[:, at]).items()}
        )
    return {"errors": rows, "savings": savings, "ranking": ranking(rows, counts)}


def ranking(rows: list[dict], counts: list[int]) -> list[dict]:
    """Geometric mean over problems of RMSE / RMSE of random, by dimension, method and L, sorted by L = 100.

    Translations with p = 2 are excluded, because orthogonal blocks are exact for them.
    """
    rows = [row for row in rows if (row["pair"], row["p"]) != ("translation", 2)]
    random = {_problem(row): row["rmse"] for row in rows if row["method"] == "random"}
    ratios: dict[tuple, dict[int, list]] = {}
    for row in rows:
        of_method = ratios.setdefault((row["d"], row["method"]), {})
        of_method.setdefault(row["L"], []).append(row["rmse"] / random[_problem(row)])
    found = [
        {"d": d, "method": method}
        | {f"ratio_{count}": _short(np.exp(np.log(values[count]).mean())) for count in counts}
        | {"worst_100": _short(max(values[RANKED_AT]))}
        for (d, method), values in ratios.items()
    ]
    return sorted(found, key=lambda row: (row["d"], row[f"ratio_{RANKED_AT}"]))


def _problem(row: dict) -> tuple:
    return tuple(row[name] for name in ("d", "pair", "p", "L"))


def _random_of(found: list[dict], entry: dict) -> np.ndarray:
    """Squared errors of random directions for the same problem."""
    same = [e for e in found if e["method"] == "random" and all(e[k] == entry[k] for k in ("d", "pair", "p"))]
    return np.square(same[0]["errors"])


def _resampled(n: int, n_resamples: int) -> np.ndarray:
    return np.random.default_rng(0).integers(n, size=(n_resamples, n))


def _slopes(counts: list[int], rmse: np.ndarray) -> np.ndarray:
    x = np.log(counts) - np.log(counts).mean()
    return np.log(np.maximum(rmse, 1e-16)) @ x / (x @ x)


def _interval(values: np.ndarray) -> dict:
    low, high = percentile_interval(values)
    return {"low": _short(low), "high": _short(high)}


def _short(value: float) -> float:
    """The value with four significant digits, so that the committed file stays small."""
    return float(f"{value:.4g}")
