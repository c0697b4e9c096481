"""Slopes in the edge length, and the comparison of varifolds with samples of the same size."""

import numpy as np

from meshot.statistics import bootstrap_interval
from meshot.types import Array
from meshot_book.statistics import fitted_slope, short

QUANTITIES = ("other", "own")


def summarise(rows: list[dict], config: dict) -> dict:
    """``rates``: for each family, space, exponent, encoding and quantity the errors by level and their slope.

    ``duels``: at every level the ratio of the mean error of samples to that of the varifold, with its interval.
    """
    groups: dict[tuple, list[dict]] = {}
    for row in (row for row in rows if row["task"]["part"] == "levels"):
        groups.setdefault((row["task"]["family"], row["task"]["d"]), []).append(row)
    rates, duels = [], []
    for (family, d), group in groups.items():
        group = sorted(group, key=lambda row: row["task"]["level"])
        first = [row["task"]["level"] for row in group].index(config["families"][family]["fit_from"])
        for p in map(str, config["exponents"]):
            encodings = {rule: [row["found"]["atoms"][rule][p] for row in group] for rule in group[0]["found"]["atoms"]}
            encodings["samples"] = [row["found"]["samples"][p] for row in group]
            common = {"family": family, "d": d, "p": int(p)}
            for quantity in QUANTITIES:
                for encoding, lists in encodings.items():
                    named = common | {"encoding": encoding, "quantity": quantity}
                    rates.append(named | _rate([one[quantity] for one in lists], group, p, first))
                pairs = zip(encodings["samples"], encodings["barycentres"], strict=True)
                for row, (samples, varifold) in zip(group, pairs, strict=True):
                    sizes = {"level": row["task"]["level"], "n_faces": row["found"]["n_faces"]}
                    duel = ratio_of_means(samples[quantity], varifold[quantity])
                    duels.append(common | sizes | {"quantity": quantity} | duel)
    return {"rates": rates, "duels": duels}


def _rate(errors: list[list[float]], group: list[dict], p: str, first: int) -> dict:
    edges = [row["found"]["edge"] for row in group]
    slope, low, high = fitted_slope(edges[first:], errors[first:])
    return {
        "n_faces": [row["found"]["n_faces"] for row in group],
        "edge": [short(edge) for edge in edges],
        "exact": [row["found"]["exact"][p] for row in group],
        "error": [short(np.abs(one).mean()) for one in errors],
        "one_sign": [bool((np.array(one) > 0).all() or (np.array(one) < 0).all()) for one in errors],
        "slope": short(slope),
        "low": short(low),
        "high": short(high),
    }


def ratio_of_means(samples: list[float], varifold: list[float]) -> dict:
    """Mean absolute error of samples over that of the varifold, with its 95 % interval (percentile bootstrap)."""

    def ratio(top: Array, bottom: Array, axis: int) -> Array:
        return top.mean(axis=axis) / bottom.mean(axis=axis)

    found = bootstrap_interval(np.abs(samples), np.abs(varifold), statistic=ratio)
    return {name: short(value) for name, value in zip(("ratio", "low", "high"), found)}


def summarise_clock(rows: list[dict]) -> list[dict]:
    """For each pair the methods with median seconds and root mean square relative error, and their crossings."""
    found = []
    for row in (row for row in rows if row["task"]["part"] == "clock"):
        lines = [
            {
                "way": line["way"],
                "size": line["size"],
                "seconds": line["seconds"],
                "error": short(np.sqrt(np.mean(np.square(line["errors"])))),
                "bias": short(np.mean(line["errors"])),
            }
            for line in row["found"]["rows"]
        ]
        pair = {"pair": row["task"]["pair"], "truth": row["found"]["truth"]}
        found.append(pair | {"rows": lines, "crossings": crossings(lines)})
    return found


def crossings(lines: list[dict]) -> dict:
    """The error of samples in the time of the exact value, and the samples needed for the varifold's error.

    Interpolated on logarithmic axes. Beyond the largest sample it is extrapolated along the fitted line, and marked so.
    """
    found = {}
    exact = next(line for line in lines if line["way"] == "exact")
    varifold = next(line for line in lines if line["way"] == "varifold" and line["size"] == exact["size"])
    for way in ("samples", "samples, same draws"):
        series = [line for line in lines if line["way"] == way]
        seconds = np.log([line["seconds"] for line in series])
        errors = np.log([line["error"] for line in series])
        slope, height = np.polyfit(seconds[-5:], errors[-5:], 1)
        needed = float(np.exp((np.log(varifold["error"]) - height) / slope))
        found[way] = {
            "error_in_the_time_of_exact": short(np.exp(np.interp(np.log(exact["seconds"]), seconds, errors))),
            "slope_in_seconds": short(slope),
            "seconds_for_the_error_of_varifold": short(needed),
            "times_slower_than_varifold": short(needed / varifold["seconds"]),
            "extrapolated": bool(needed > series[-1]["seconds"]),
        }
    return found
