"""Errors and times of sampled estimates of the same value."""

import statistics
import time
from collections.abc import Callable

import numpy as np
import torch

from meshot import DiscreteMeasure, Mesh, empirical, quasi_directions, sliced_wasserstein, surface
from meshot.anatomy import fsaverage5_surface
from meshot.mesh import face_areas, face_barycentres, face_corners, folded_sphere, icosphere
from meshot.types import Tensor


def pairs(config: dict) -> dict[str, tuple[Mesh, Mesh]]:
    """Surfaces of 20 480 faces in mm: far apart, near and very near."""
    folded = folded_sphere(5, 40.0, 6.0)
    lengths = folded.vertices.norm(dim=1, keepdim=True)
    wave = torch.sin(9 * folded.vertices / lengths).mean(dim=1, keepdim=True)
    return {
        "spheres of 40 and 38": (icosphere(5, 40.0), icosphere(5, 38.0)),
        "folds 6 and 4 deep": (folded, folded_sphere(5, 40.0, 4.0)),
        "white and pial": (fsaverage5_surface("white", "left"), fsaverage5_surface("pial", "left")),
        "tiny deformation": (
            folded,
            folded.with_vertices(folded.vertices * (1 + config["sampling"]["tiny"] * wave / lengths)),
        ),
    }


def sampling(config: dict) -> list[dict]:
    """For every pair the exact SW₂², and estimates from samples and from one point per cell, with equal directions."""
    directions, rows = quasi_directions(config["n_directions"], 3), []
    for name, pair in pairs(config).items():
        exact = float(sliced_wasserstein(*map(surface, pair), directions))
        row = {"pair": name, "exact": exact, "sampled": []}
        for size in config["sampling"]["sizes"]:
            row["sampled"].append({"n_points": size, **_sampled(pair, size, exact, directions, config)})
        for kind, points in PROXIES.items():
            value = float(sliced_wasserstein(*map(points, pair), directions))
            row[kind] = value / exact - 1
        rows.append(row)
    return rows


def _sampled(pair: tuple[Mesh, Mesh], size: int, exact: float, directions: Tensor, config: dict) -> dict:
    """Relative errors: the mean (the bias over many draws) and the root mean square (of one draw)."""
    errors = []
    for seed in config["sampling"]["seeds"]:
        generator = np.random.default_rng([seed, size])
        drawn = [empirical(mesh, size, generator, detach_weights=True) for mesh in pair]
        errors.append(float(sliced_wasserstein(*drawn, directions)) / exact - 1)
    return {"mean_error": statistics.fmean(errors), "rms_error": float(np.sqrt(np.mean(np.square(errors))))}


def _barycentres(mesh: Mesh) -> DiscreteMeasure:
    areas = face_areas(mesh)
    return DiscreteMeasure(face_barycentres(mesh), areas / areas.sum())


def _spread(points: Callable[[Mesh], Tensor]) -> Callable[[Mesh], DiscreteMeasure]:
    """The mass of every face in equal parts on some of its points."""

    def measure(mesh: Mesh) -> DiscreteMeasure:
        areas, places = face_areas(mesh), points(mesh)
        weights = (areas / areas.sum())[:, None].expand(places.shape[:2]) / places.shape[1]
        return DiscreteMeasure(places.reshape(-1, 3), weights.reshape(-1))

    return measure


PROXIES = {
    "barycentres": _barycentres,
    "edge_midpoints": _spread(lambda mesh: (face_corners(mesh) + face_corners(mesh).roll(1, dims=1)) / 2),
    "vertices": _spread(face_corners),
}


def times(config: dict) -> dict:
    """CPU seconds on one thread, medians over rounds in which methods alternate; ratios to exact value and gradient."""
    settings = config["time"]
    source, target = (folded_sphere(settings["subdivisions"], 40.0, depth) for depth in (6.0, 4.0))
    directions = quasi_directions(config["n_directions"], 3)
    moving = source.vertices.clone().requires_grad_()
    generator = np.random.default_rng(0)

    def exact() -> Tensor:
        return sliced_wasserstein(surface(source.with_vertices(moving)), surface(target), directions)

    def sampled(size: int) -> Tensor:
        drawn = [
            empirical(mesh, size, generator, detach_weights=True) for mesh in (source.with_vertices(moving), target)
        ]
        return sliced_wasserstein(*drawn, directions)

    calls = {"exact, value": lambda: sliced_wasserstein(surface(source), surface(target), directions)}
    calls["exact"] = lambda: exact().backward()
    for size in settings["sizes"]:
        calls[f"{size} points"] = lambda size=size: sampled(size).backward()
    seconds: dict[str, list[float]] = {name: [] for name in calls}
    for turn in range(settings["n_rounds"] + 1):
        for name, call in calls.items():
            started = time.process_time()
            call()
            if turn:  # the first turn compiles
                seconds[name].append(time.process_time() - started)
    medians = {name: statistics.median(found) for name, found in seconds.items()}
    ratios = {name: value / medians["exact"] for name, value in medians.items()}
    return {"n_faces": len(source.faces), "seconds": medians, "ratio_to_exact": ratios}
