"""One measurement: a metric between two independent samples of one surface."""

import functools
import math

import numpy as np
import ot
import torch
from geomloss import SamplesLoss
from scipy.spatial import cKDTree

from meshot.anatomy import fsaverage5_surface
from meshot.metrics import Surface, SurfaceSample, average_surface_distance, earth_movers_distance, sliced_distance


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
