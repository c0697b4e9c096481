"""The exact sliced loss of continuous surfaces: its accuracy, its time, the error of samples, and a descent with it."""

import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch

from meshot import (
    DiscreteMeasure,
    Mesh,
    SurfaceMeasure,
    empirical,
    quasi_directions,
    random_directions,
    sliced_wasserstein,
    surface,
)
from meshot.anatomy import fsaverage5_surface
from meshot.mesh import cube, face_areas, face_barycentres, face_corners, folded_sphere, icosphere, tetrahedron
from meshot.metrics import Surface, average_surface_distance
from meshot.types import Tensor

sys.path.extend(str(Path(__file__).resolve().parents[2] / name) for name in ("tests", "experiments"))
import experiment

import oracles_exact


def accuracy(config: dict) -> dict:
    """Values with their references, the convergence order of icospheres to spheres, and gradients."""
    settings = config["accuracy"]
    values = [row for p in (1, 2) for row in _closed_forms(settings, p) + _by_brute_force(p)]
    return {"values": values, "spheres": _spheres(settings), "gradients": _gradients(settings)}


def _row(name: str, p: int, exact: float, pair: tuple, directions: Tensor) -> dict:
    ours = float(sliced_wasserstein(*pair, directions, p))
    return {"case": name, "p": p, "exact": exact, "ours": ours, "error": abs(ours - exact) / exact}


def _closed_forms(settings: dict, p: int) -> list[dict]:
    folded, eye = folded_sphere(4, 1.0, 0.2), torch.eye(3, dtype=torch.float64)
    shift = torch.tensor(settings["shift"], dtype=torch.float64)
    moved = folded.with_vertices(folded.vertices + shift)
    along_axis = (1 / 3) * 0.5**p + (2 / 3) * 0.5**p / (p + 1)
    return [
        _row("translation", p, float(shift.abs().pow(p).mean()), (surface(folded), surface(moved)), eye),
        _row("cubes of sides 1 and 2, edge-on", p, along_axis, (surface(cube()), surface(cube(2.0))), eye),
    ]


def _by_brute_force(p: int) -> list[dict]:
    directions = random_directions(2, 3, 0)
    pairs = {
        "tetrahedron and cube": (surface(tetrahedron()), surface(cube(1.3))),
        "sphere and folds": (surface(icosphere(1)), surface(folded_sphere(1, 1.0, 0.2))),
        "crossing triangles": (_crossing(1), _crossing(2)),
    }
    return [
        _row(f"{name}, by quadrature", p, oracles_exact.sliced_cost(*pair, directions, p), pair, directions)
        for name, pair in pairs.items()
    ]


def _crossing(seed: int) -> SurfaceMeasure:
    generator = np.random.default_rng(seed)
    cells = torch.from_numpy(np.stack([generator.choice(9, 3, replace=False) for _ in range(12)]))
    weights = torch.from_numpy(generator.random(12) + 0.1)
    return SurfaceMeasure(torch.from_numpy(generator.standard_normal((9, 3))), cells, weights / weights.sum())


def _spheres(settings: dict) -> list[dict]:
    """A projected sphere is uniform on an interval: W₂² = (r − s)²/3. Icospheres converge to it with finer edges."""
    directions, rows = random_directions(16, 3, 0), []
    for subdivisions in settings["sphere_subdivisions"]:
        pair = surface(icosphere(subdivisions)), surface(icosphere(subdivisions, 1.5))
        error = abs(float(sliced_wasserstein(*pair, directions)) * 12 - 1)
        rows.append({"n_faces": 20 * 4**subdivisions, "relative_error": error})
    return rows


def _gradients(settings: dict) -> list[dict]:
    """Directional derivatives for random motions of all vertices, compared with central differences."""
    mesh, target, directions = folded_sphere(2, 1.0, 0.2), surface(icosphere(2, 1.3)), random_directions(8, 3, 0)
    rows = []
    for p in (1, 2):
        vertices = mesh.vertices.clone().requires_grad_()
        sliced_wasserstein(surface(mesh.with_vertices(vertices)), target, directions, p).backward()
        errors = []
        for seed in range(settings["n_gradient_checks"]):
            motion = torch.from_numpy(np.random.default_rng(seed).standard_normal(mesh.vertices.shape))
            slope = float((vertices.grad * motion).sum())
            ends = [_at(mesh, sign * settings["step"] * motion, target, directions, p) for sign in (1, -1)]
            errors.append(abs((ends[0] - ends[1]) / (2 * settings["step"]) - slope) / abs(slope))
        rows.append({"p": p, "largest_relative_error": max(errors)})
    return rows


def _at(mesh: Mesh, motion: Tensor, target: SurfaceMeasure, directions: Tensor, p: int) -> float:
    moved = mesh.with_vertices(mesh.vertices + motion)
    return float(sliced_wasserstein(surface(moved), target, directions, p))


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


ENCODINGS = ("continuous", "barycentres", "samples")


def descents(config: dict) -> dict[str, list[dict]]:
    """For every encoding its own rate, by the surface distance of one seed, and descents from other seeds with it."""
    settings, trials, runs = config["descent"], [], []
    for encoding in ENCODINGS:
        tried = [descend_once(encoding, settings["trial_seed"], rate, config) for rate in settings["rates"]]
        rate = min(tried, key=lambda row: row["end"]["surface_distance"])["rate"]
        trials += tried
        runs += [descend_once(encoding, seed, rate, config) for seed in settings["seeds"]]
    return {"descent_rates": trials, "descent": runs}


def descend_once(encoding: str, seed: int, rate: float, config: dict) -> dict:
    """Free vertices, Adam with a cosine schedule, new directions at every step, no regulariser."""
    settings = config["descent"]
    start = icosphere(settings["source_subdivisions"], 40.0)
    target = folded_sphere(settings["target_subdivisions"], 40.0, settings["depth"])
    generator = np.random.default_rng([seed, 3])
    vertices = start.vertices.clone().requires_grad_()
    optimiser = torch.optim.Adam([vertices], lr=rate)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, settings["n_steps"])
    for _ in range(settings["n_steps"]):
        directions = random_directions(config["n_directions"], 3, generator)
        pair = [
            _encoded(mesh, encoding, len(target.faces), generator) for mesh in (start.with_vertices(vertices), target)
        ]
        optimiser.zero_grad()
        sliced_wasserstein(*pair, directions).backward()
        optimiser.step()
        schedule.step()
    end = start.with_vertices(vertices.detach())
    before, after = (_judged(mesh, target, settings) for mesh in (start, end))
    return {"encoding": encoding, "rate": rate, "seed": seed, "start": before, "end": after}


def _encoded(mesh: Mesh, encoding: str, n_points: int, generator: np.random.Generator) -> object:
    """The encoding of a mesh. Samples are new ones, as many on either side as the target has faces."""
    if encoding == "continuous":
        return surface(mesh)
    if encoding == "samples":
        return empirical(mesh, n_points, generator, detach_weights=True)
    areas: Tensor = face_areas(mesh)
    return DiscreteMeasure(face_barycentres(mesh), areas / areas.sum())


def _judged(mesh: Mesh, target: Mesh, settings: dict) -> dict:
    """The exact SW₂ along directions not used in the descent, and the mean distance to the other's faces, in mm."""
    directions = quasi_directions(settings["n_judging_directions"], 3, seed=1)
    squared = float(sliced_wasserstein(surface(mesh), surface(target), directions))
    sides = Surface(mesh), Surface(target)
    samples = [side.sample(20_000, seed) for seed, side in enumerate(sides)]
    distance = average_surface_distance(sides[1].offsets(samples[0]), sides[0].offsets(samples[1]))
    return {"sliced_distance": squared**0.5, "surface_distance": distance}


PARTS = {"accuracy": accuracy, "sampling": sampling, "time": times, "descent": descents}


def summarise(rows: list[dict], config: dict) -> dict:
    """The results of all parts."""
    found = {row["task"]: row["found"] for row in rows}
    return found | found.pop("descent")


if __name__ == "__main__":
    data = "synthetic shapes; the white and pial surfaces of fsaverage5"
    experiment.run(__file__, lambda config: list(PARTS), lambda part, config: PARTS[part](config), summarise, data)
