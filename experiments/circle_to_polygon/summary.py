"""Means, deviations and intervals over seeds."""

import numpy as np
from toy import draw_points, judged, polygon

from meshot import DiscreteMeasure
from meshot.provenance import rounded
from meshot_book.statistics import arm_differences

MEASURED = ("w2", "coverage", "coverage_3", "evenness", "off_contour", "chamfer", "sw")


def summarise(rows: list[dict]) -> dict:
    """Statistics of every part over seeds, and Chamfer minus sliced Wasserstein where both were run."""
    groups: dict[str, list[dict]] = {}
    for row in rows:
        groups.setdefault(repr(row["run"]), []).append(row)
    results: dict[str, list] = {"summary": [], "differences": [], "regularisers": [], "sizes": []}
    for group in groups.values():
        run = dict(group[0]["run"])
        results[run.pop("part")].append(run | _statistics(group))
    main = [row for row in results["summary"] if row["reduction"] == "mean"]
    for trapped in (row for row in main if row["loss"] == "chamfer"):
        for rival in (row for row in main if row["loss"] == "sliced"):
            if all(rival[name] == trapped[name] for name in ("polygon", "sampling")):
                results["differences"].append(_difference(trapped, rival))
    return results


def _statistics(group: list[dict]) -> dict:
    found = {}
    for name in MEASURED:
        values = np.array([row["values"][name] for row in group])
        found[f"{name}_mean"], found[f"{name}_sd"] = _short(values.mean()), _short(values.std(ddof=1))
        found[f"{name}_seeds"] = [_short(value) for value in values]
    return found | {"n_seeds": len(group)}


def _difference(trapped: dict, rival: dict) -> dict:
    """Mean over seeds of the paired difference Chamfer minus sliced Wasserstein, with its 95 % interval (Student)."""
    found = {name: trapped[name] for name in ("polygon", "sampling")} | {"redraw": rival["redraw"]}
    arms = ({name: arm[f"{name}_seeds"] for name in MEASURED} for arm in (trapped, rival))
    return found | rounded(arm_differences(*arms, centre="mean")) | {"n_seeds": len(trapped["w2_seeds"])}


def floors(config: dict) -> list[dict]:
    """The metrics of an even sampling, and of an independent sample of the target, against another sample."""
    rows = []
    for name, settings in config["polygons"].items():
        shape = polygon(settings)
        for sampling in config["samplings"]:
            group = []
            for seed in range(config["n_floor_samples"]):
                generator = np.random.default_rng([seed, 2])
                pair = [draw_points(shape, config["n_points"], sampling, generator) for _ in range(2)]
                group.append({"values": judged(pair[0], DiscreteMeasure(pair[1]), shape)})
            row = _statistics(group)
            kept = {key: value for key, value in row.items() if not key.endswith("_seeds") or key == "n_seeds"}
            rows.append({"polygon": name, "sampling": sampling} | kept)
    return rows


def _short(value: float) -> float:
    """The value with six significant digits, so that the committed file stays small."""
    return float(f"{value:.6g}")
