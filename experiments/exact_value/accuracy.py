"""Accuracy against closed forms, a brute-force implementation, and finite differences."""

import sys
from pathlib import Path

import numpy as np
import torch

from meshot import Mesh, SurfaceMeasure, random_directions, sliced_wasserstein, surface
from meshot.mesh import cube, folded_sphere, icosphere, tetrahedron
from meshot.types import Tensor

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))
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
