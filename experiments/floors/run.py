"""Measure the floors of EMD, SWD and ASSD, and extrapolate them to the paper's number of points."""

import itertools
import sys
from pathlib import Path

from extrapolation import Groups, matching_law, power_law, ratios_of, slope_of, with_interval
from readings import emd_readings, paper_number
from samples import measured, surface_of

from meshot.mesh import face_areas
from meshot.provenance import rounded

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment

DIRECT = ("sw2", "point_to_point", "point_to_face")


def all_tasks(config: dict) -> list[dict]:
    """All pairs of samples to measure, the fast ones first."""
    counts, tasks = config["repetitions"], []
    every, white = config["surfaces"], [s for s in config["surfaces"] if s[0] == "white"]
    for metric in DIRECT:
        tasks += _tasks({"metric": metric}, every, counts[metric])
    tasks += _tasks({"metric": "exact_w2"}, every, counts["exact_w2"])
    tasks += _tasks({"metric": "exact_w1"}, every[:1], counts["exact_w1"])
    for setting in config["sinkhorn"]["settings"]:
        kind = {"metric": "sinkhorn", "setting": setting, "scaling": config["sinkhorn"]["scaling"]}
        tasks += _tasks(kind, every[:1], config["sinkhorn"]["repetitions"])
    return tasks + _tasks({"metric": "exact_w2"}, white, counts["exact_w2_largest"])


def _tasks(kind: dict, surfaces: list, counts: dict[int, int]) -> list[dict]:
    pairs = itertools.product(surfaces, counts.items())
    return [kind | {"surface": surface, "m": m, "seed": seed} for surface, (m, n) in pairs for seed in range(n)]


def summarise(rows: list[dict], config: dict) -> dict:
    """Means and deviations over m, slopes, and predictions at the paper's number of points."""
    found: dict[tuple, Groups] = {}
    for row in rows:
        task = row["task"]
        key = (task["metric"], tuple(task["surface"]), tuple(sorted(task.get("setting", {}).items())))
        found.setdefault(key, {}).setdefault(task["m"], []).append(row["found"])
    exact = {
        (tuple(row["task"]["surface"]), row["task"]["m"], row["task"]["seed"]): row["found"]
        for row in rows
        if row["task"]["metric"] == "exact_w2"
    }
    floors = [floor_row(*key, groups, exact, config) for key, groups in found.items()]
    return rounded(
        {
            "number_mm": paper_number(),
            "readings": emd_readings(floors, config["from_m"]),
            "areas_mm2": {" ".join(s): area_of(s) for s in config["surfaces"]},
            "floors": floors,
            "seconds": seconds_of(rows),
        }
    )


def area_of(surface: list[str]) -> float:
    """Total area in mm²."""
    return float(face_areas(surface_of(*surface).mesh).sum())


def floor_row(metric: str, surface: tuple, setting: tuple, groups: Groups, exact: dict, config: dict) -> dict:
    """One metric on one surface: measured values, their decrease, and the prediction."""
    target, options = config["target_m"], (config["n_draws"], config["seed"])
    groups = dict(sorted(groups.items()))
    row = {"metric": metric, "surface": " ".join(surface), "setting": dict(setting)}
    row["measured"] = [{"m": m, "values": values} for m, values in groups.items()]
    late = {m: values for m, values in groups.items() if m >= config["from_m"] or metric in DIRECT}
    laws = {} if metric in DIRECT else {"power law": with_interval(power_law, late, target, *options)}
    if metric == "exact_w2":
        laws["matching law"] = with_interval(matching_law(area_of(surface)), late, target, *options)
    elif metric not in DIRECT:
        own = {(m, seed): value for (name, m, seed), value in exact.items() if name == surface}
        ratios = ratios_of(groups, own)
        row["over_exact_w2"] = [{"m": m, "values": values} for m, values in ratios.items()]
        late_ratios = {m: values for m, values in ratios.items() if m in late}
        row["ratio_at_target"] = with_interval(power_law, late_ratios, target, *options)
    if len(late) > 1:
        row["slope"] = slope_of(late, *options)
    return row | {"at_target": laws or {"measured": spread(groups[target])}}


def spread(values: list[float]) -> dict:
    """The mean of the values at the target size, and their extremes."""
    return {"value": sum(values) / len(values), "low": min(values), "high": max(values)}


def seconds_of(rows: list[dict]) -> list[dict]:
    """CPU seconds of one exact EMD over the number of points, mean over repetitions."""
    exact = [row for row in rows if row["task"]["metric"] == "exact_w2"]
    sizes = sorted({row["task"]["m"] for row in exact})
    means = {m: [row["seconds"] for row in exact if row["task"]["m"] == m] for m in sizes}
    return [{"m": m, "cpu_seconds": sum(values) / len(values)} for m, values in means.items()]


if __name__ == "__main__":
    data = "fsaverage5 white and pial surfaces (group averages)"
    experiment.run(__file__, all_tasks, lambda task, config: measured(task), summarise, data)
