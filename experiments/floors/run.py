"""Measure the floors of EMD, SWD and ASSD, and extrapolate them to the paper's number of points."""

import functools
import itertools
import math
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import ot
import torch
import yaml
from geomloss import SamplesLoss
from scipy.spatial import cKDTree

from meshot.anatomy import fsaverage5_surface
from meshot.mesh import face_areas
from meshot.metrics import Surface, SurfaceSample, average_surface_distance, earth_movers_distance, sliced_distance
from meshot.provenance import rounded
from meshot.statistics import percentile_interval
from meshot_book.statistics import fitted_slope

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment

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


def slope_of(groups: Groups, n_draws: int, seed: int) -> dict:
    """The exponent of the mean over the number of points, with its interval."""
    slope, low, high = fitted_slope(list(groups), list(groups.values()), "mean", n_draws, seed)
    return {"value": slope, "low": low, "high": high}


PAPER = Path(__file__).resolve().parents[1] / "paper_table" / "paper.yaml"


def paper_number() -> float:
    """The smallest EMD (mm) in the paper for its own system on ADNI, where EMD is larger than SWD."""
    table = yaml.safe_load(PAPER.read_text(encoding="utf-8"))["table_1"]["ADNI"]
    return min(table[side]["DDOT"][0][0] for side in ("left", "right"))


def emd_readings(floors: list[dict], from_m: int) -> list[dict]:
    """Each interpretation with its floor at the target size: the union of the intervals of models and surfaces."""
    w2 = _exact_ends(floors)
    rows = [
        _reading("exact W₂", w2, "mm"),
        _reading("exact W₁", _scaled(w2, floors, "exact_w1", {}), "mm"),
        _reading("the root of half the squared cost, √(½ W₂²)", [end / math.sqrt(2) for end in w2], "mm"),
        _reading("half the squared cost, ½ W₂²", [end**2 / 2 for end in w2], "mm²"),
    ]
    for name, setting in (("in mm", {"blur_mm": 0.05}), ("in [-1, 1]", {"blur": 0.05})):
        ends = _scaled(w2, floors, "sinkhorn", setting | {"debias": True})
        rows.append(_reading(f"GeomLoss, its default blur of 0.05 {name}, doubled and rooted", ends, "mm"))
    for row, metric in zip(rows, ["exact_w2", "exact_w1", "exact_w2", "exact_w2", "sinkhorn", "sinkhorn"]):
        largest = max(m["m"] for floor in floors if floor["metric"] == metric for m in floor["measured"])
        row["how"] = f"extrapolated from {from_m} to {largest} points"
        row["how"] += "" if metric == "exact_w2" else ", as a ratio to exact W₂"
    return rows


def _exact_ends(floors: list[dict]) -> list[float]:
    laws = [
        law
        for row in floors
        if row["metric"] == "exact_w2" and row["surface"].startswith("white")
        for law in row["at_target"].values()
    ]
    return [min(law["low"] for law in laws), max(law["high"] for law in laws)]


def _scaled(w2: list[float], floors: list[dict], metric: str, setting: dict) -> list[float]:
    """The ends for a metric measured with fewer points, from its ratio to exact W₂ on the same samples."""
    (row,) = [row for row in floors if (row["metric"], row["setting"]) == (metric, setting)]
    ratio = row["ratio_at_target"]
    return [w2[0] * ratio["low"], w2[1] * ratio["high"]]


def _reading(name: str, ends: list[float], unit: str) -> dict:
    return {"reading": name, "low": ends[0], "high": ends[1], "unit": unit}


@functools.cache
def surface_of(kind: str, hemisphere: str) -> Surface:
    """One of the four surfaces, with its search tree."""
    return Surface(fsaverage5_surface(kind, hemisphere))


def two_samples(surface: Surface, m: int, seed: int) -> tuple[SurfaceSample, SurfaceSample]:
    """Two independent samples of ``m`` points, uniform by area."""
    streams = np.random.SeedSequence([seed, m]).spawn(2)
    one, other = (surface.sample(m, np.random.default_rng(stream)) for stream in streams)
    return one, other


def measured(task: dict) -> float:
    """The value of one task, in mm."""
    surface = surface_of(*task["surface"])
    one, other = two_samples(surface, task["m"], task["seed"])
    if task["metric"] == "point_to_face":
        offsets = surface.offsets(one), surface.offsets(other)
        return average_surface_distance(*offsets)
    if task["metric"] == "sinkhorn":
        return sinkhorn_length(one.points, other.points, task["setting"], task["scaling"])
    return METRICS[task["metric"]](one.points, other.points)


def exact_w1(points: np.ndarray, others: np.ndarray) -> float:
    """W₁: the minimal mean distance over pairings, in mm."""
    masses = np.full(len(points), 1 / len(points))
    cost = ot.dist(points, others, metric="euclidean")
    return float(ot.emd2(masses, masses, cost, numItermax=100 * len(points) ** 2))


def point_to_point(points: np.ndarray, others: np.ndarray) -> float:
    """The mean distance to the nearest *point* of the other sample, averaged over the two sides, in mm."""
    there, back = cKDTree(others).query(points)[0], cKDTree(points).query(others)[0]
    return float(there.mean() + back.mean()) / 2


def sinkhorn_length(points: np.ndarray, others: np.ndarray, setting: dict, scaling: float) -> float:
    """The root of twice GeomLoss's value, in mm, with the sign of the value."""
    both = np.concatenate([points, others])
    middle = (both.max(axis=0) + both.min(axis=0)) / 2
    unit = 1.0 if "blur_mm" in setting else float(np.abs(both - middle).max())
    blur = setting.get("blur_mm", setting.get("blur"))
    loss = SamplesLoss("sinkhorn", p=2, blur=blur, scaling=scaling, debias=setting["debias"], backend="tensorized")
    x, y = (torch.from_numpy((side - middle) / unit) for side in (points, others))
    with torch.no_grad():
        doubled = 2 * float(loss(x, y))
    return math.copysign(math.sqrt(abs(doubled)), doubled) * unit


METRICS = {
    "exact_w2": earth_movers_distance,
    "exact_w1": exact_w1,
    "sw2": sliced_distance,
    "point_to_point": point_to_point,
}


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
        # Each value over exact W₂ of the same samples. The ratio varies less than either, since both share the draw.
        ratios = {m: [value / own[m, seed] for seed, value in enumerate(values)] for m, values in groups.items()}
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
