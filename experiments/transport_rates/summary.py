"""Errors over sizes, and their slopes, with intervals."""

import numpy as np

from meshot_book.statistics import fitted_slope

#: Shapes whose intrinsic dimension is that of the space.
SOLID = ("cube", "two_cubes")


def summarise(rows: list[dict], config: dict) -> dict:
    """For every estimator, pair and exponent the mean absolute errors over sizes, and the fitted slope."""
    groups: dict[tuple, list[dict]] = {}
    for row in rows:
        task = row["task"]
        for p in row["values"]:
            groups.setdefault((task["estimate"], task["shape"], task["d"], task["relation"], p), []).append(row)
    results: dict[str, list] = {"transport": [], "sliced": [], "chamfer": []}
    for (estimate, shape, d, relation, p), group in groups.items():
        pair = {"shape": shape, "d": d, "relation": relation}
        results[estimate].append(pair | {"p": int(p)} | _line(group, p, estimate, pair, config))
    return results


def _line(group: list[dict], p: str, estimate: str, pair: dict, config: dict) -> dict:
    group = sorted(group, key=lambda row: row["task"]["n_points"])
    sizes = [row["task"]["n_points"] for row in group]
    errors = [np.array(row["values"][p]) for row in group]
    first = sizes.index(config[estimate]["fit_from"])
    slope, low, high = fitted_slope(sizes[first:], errors[first:])
    return {
        "dimension": intrinsic_dimension(pair),
        "sizes": sizes,
        "n_repetitions": [len(values) for values in errors],
        "error": [_short(np.abs(values).mean()) for values in errors],
        "error_sd": [_short(np.abs(values).std(ddof=1)) for values in errors],
        "bias": [_short(values.mean()) for values in errors],
        "slope": _short(slope),
        "low": _short(low),
        "high": _short(high),
        "expected": expected_slope(estimate, pair, int(p)),
    }


def intrinsic_dimension(pair: dict) -> int:
    """2 for a surface, the dimension of the space for a solid."""
    return pair["d"] if pair["shape"] in SOLID else 2


def expected_slope(estimate: str, pair: dict, p: int) -> float | None:
    """The exponent according to theory, without logarithms; None if no statement is known.

    Equal measures of intrinsic dimension k: W_p has an error of m^(-1/max(k, 2)), and of m^(-1/(2p)) if the support is
    disconnected and that is larger. Different measures, p = 2: a bias of m^(-2/k) from matching and noise of m^(-1/2),
    unless the potential is constant by symmetry. Chamfer: squared distances to the nearest sample, m^(-2/k), and the
    same noise.
    """
    k, relation = intrinsic_dimension(pair), pair["relation"]
    if estimate == "sliced":
        split = relation == "equal" and p == 2 and pair["shape"] == "two_cubes"
        return None if split or relation == "concentric" or pair["shape"] == "cube_surface" else -0.5
    if estimate == "chamfer":
        noisy = relation in ("translated", "other_surface")
        return round(max(-2 / k, -0.5) if noisy else -2 / k, 4)
    if relation == "equal":
        pieces = pair["shape"] in ("two_cubes", "cube_surface")
        return round(max(-1 / max(k, 2), -1 / (2 * p) if pieces else -1), 4)
    if relation == "concentric":
        return round(-2 / k, 4)
    return round(max(-2 / k, -0.5), 4) if p == 2 else None


def _short(value: float) -> float:
    """The value with six significant digits, so that the committed file stays small."""
    return float(f"{value:.6g}")
