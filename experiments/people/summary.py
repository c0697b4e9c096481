"""Summary over held-out scans: means by cohort and group, and paired differences between sets of networks."""

from collections.abc import Callable

import numpy as np

from meshot.statistics import mean_interval, paired_interval

STAGES = ("initial", "final")
MEASURES = ("assd_mm", "hausdorff90_mm", "normals", "crossing_faces", "area_ratio")
OWN = ("dice", "given_up_percent")


def summarised(scans: list[dict], config: dict) -> dict:
    """Rows by cohort and networks, rows by group of the people, and the first networks against the others."""
    plan, (first, *others) = config["plan"], config["networks"]
    people = _of(scans, "people_like", first)
    grouped = {name: [scan for scan in people if _belongs(scan, limits)] for name, limits in config["groups"].items()}
    return {
        "cohorts": [
            {"cohort": cohort, "networks": name} | averaged(_of(scans, cohort, name))
            for cohort, names in plan.items()
            for name in names
        ],
        "groups": [{"group": name} | averaged(part) for name, part in grouped.items() if part],
        "differences": [
            {"cohort": cohort, "against": other}
            | difference(_of(scans, cohort, first), _of(scans, cohort, other), config["allowed_mm"][other])
            for other in others
            for cohort, names in plan.items()
            if {first, other} <= set(names)
        ],
    }


def _of(scans: list[dict], cohort: str, networks: str) -> list[dict]:
    return [scan for scan in scans if scan["subject"].split("/")[0] == cohort and scan["networks"] == networks]


def _belongs(scan: dict, limits: dict[str, list[float]]) -> bool:
    return all(low <= scan["about"][key] < high for key, (low, high) in limits.items())


def averaged(scans: list[dict]) -> dict:
    """Means over the scans of the means of both sides, and the worst side; warnings and seconds."""
    sides = [side for scan in scans for side in scan["sides"].values()]
    found = {"n_scans": len(scans), "least_dice": min(side["dice"] for side in sides)}
    found |= {name: _mean(scans, lambda side, name=name: side[name]) for name in OWN}
    for stage in STAGES:
        found[stage] = {name: _mean(scans, lambda side, at=(stage, name): side[at[0]][at[1]]) for name in MEASURES}
        found[stage]["largest_assd_mm"] = max(side[stage]["assd_mm"] for side in sides)
    found["n_with_warnings"] = sum(bool(scan["warning_names"]) for scan in scans)
    return found | {"cpu_seconds": float(np.mean([scan["cpu_seconds"] for scan in scans]))}


def per_scan(scans: list[dict], value: Callable[[dict], float]) -> list[float]:
    """The mean of a number over the two sides of each scan."""
    return [float(np.mean([value(side) for side in scan["sides"].values()])) for scan in scans]


def _mean(scans: list[dict], value: Callable[[dict], float]) -> dict[str, float | None]:
    values = per_scan(scans, value)
    interval = mean_interval(values) if len(values) > 1 else (values[0], None, None)
    return dict(zip(("mean", "low", "high"), interval))


def difference(first: list[dict], second: list[dict], allowed: float) -> dict:
    """First minus second networks, paired over the scans: ASSD of the final surface in mm.

    Raises
    ------
    ValueError
        If the two sets of networks were measured on different scans.
    """
    one, other = ({scan["subject"]: scan for scan in scans} for scans in (first, second))
    if set(one) != set(other):
        raise ValueError("the two sets of networks were measured on different scans; measure both on all of them")
    values = [per_scan([rows[name] for name in one], lambda side: side["final"]["assd_mm"]) for rows in (one, other)]
    gap, low, high = paired_interval(*values)
    return {"n_scans": len(one), "assd_mm": {"mean": gap, "low": low, "high": high}, "holds": gap <= allowed}
