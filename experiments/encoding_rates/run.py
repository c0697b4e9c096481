"""Measure the distance of varifolds and samples from the continuous measure, over the edge length and over time.

Errors are reproducible; the times of the last part are not.
"""

import functools
import math
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
from summary import summarise, summarise_clock

from meshot import DiscreteMeasure, SurfaceMeasure, quasi_directions, sliced_wasserstein, surface, varifold
from meshot.anatomy import fsaverage5_surface
from meshot.mesh import (
    Mesh,
    cube,
    decimated,
    edge_lengths,
    ellipsoid,
    face_areas,
    face_normals,
    folded_sphere,
    icosphere,
    sample_locations,
    split_in_four,
)
from meshot.types import Tensor
from meshot_book.statistics import short

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment


def continuous(mesh: Mesh, normal_scale: float) -> SurfaceMeasure:
    """The reference: the continuous surface, with its scaled face normals unless the scale is zero."""
    return surface(mesh, normal_scale=normal_scale)


def atoms(mesh: Mesh, rule: str, normal_scale: float) -> DiscreteMeasure:
    """A quadrature rule on every face: one atom at its barycentre, or a third of its area at each midpoint or corner.

    The barycentre rule with normals is the oriented varifold. The other two rules have positions only.
    """
    if rule == "barycentres":
        encoded = varifold(mesh, normal_scale=normal_scale)
        points = encoded.points if normal_scale > 0 else encoded.points[:, :3].contiguous()
        return DiscreteMeasure(points, encoded.weights)
    corners = mesh.vertices[mesh.faces]
    places = corners if rule == "vertices" else (corners + corners.roll(1, dims=1)) / 2
    points, which = torch.unique(places.reshape(-1, 3), dim=0, return_inverse=True)
    areas = face_areas(mesh)
    shares = (areas / areas.sum() / 3).repeat_interleave(3)
    return DiscreteMeasure(points, torch.zeros(len(points), dtype=shares.dtype).index_add(0, which, shares))


def sample(mesh: Mesh, n_points: int, normal_scale: float, generator: np.random.Generator) -> DiscreteMeasure:
    """Independent points, uniform by area, each with the scaled normal of its face unless the scale is zero."""
    faces, barycentric = sample_locations(mesh, n_points, generator)
    points = (barycentric[:, :, None] * mesh.vertices[mesh.faces[faces]]).sum(dim=1)
    if normal_scale > 0:
        points = torch.cat([points, normal_scale * face_normals(mesh)[faces]], dim=1)
    return DiscreteMeasure(points)


def pair_of_meshes(family: str, level: int, config: dict) -> tuple[Mesh, Mesh]:
    """The mesh of a family at a level, and the mesh that it is compared with, refined in the same way."""
    if family in ("cube", "uneven_cube"):
        refine = refined if family == "cube" else refined_on_one_side
        return refine(cube(), level), refine(turned_box(), level)
    if family == "sphere":
        return icosphere(level), ellipsoid(level, (1.1, 0.9, 0.8))
    if family == "folded_sphere":
        return folded_sphere(level, 1.0, 0.15, 5), icosphere(level)
    white, pial = (_cortex(kind, config["cortex"]["hemisphere"]) for kind in ("white", "pial"))
    if family == "cortex_decimated":
        return decimated(white, level), decimated(pial, level)
    n_faces = config["cortex"]["coarsest"]
    return refined(decimated(white, n_faces), level), refined(decimated(pial, n_faces), level)


@functools.cache
def _cortex(kind: str, hemisphere: str) -> Mesh:
    return fsaverage5_surface(kind, hemisphere)


def turned_box() -> Mesh:
    """A box with unequal sides, rotated and translated, so that no face is parallel to a face of the cube."""
    box = cube()
    a, b = 0.4, 0.7
    about_z = torch.tensor([[math.cos(a), -math.sin(a), 0], [math.sin(a), math.cos(a), 0], [0, 0, 1]])
    about_x = torch.tensor([[1, 0, 0], [0, math.cos(b), -math.sin(b)], [0, math.sin(b), math.cos(b)]])
    sides, shift = torch.tensor([1.2, 0.9, 0.8]), torch.tensor([0.2, 0.1, -0.1])
    turn = (about_x @ about_z).to(torch.float64)
    return box.with_vertices((box.vertices * sides.to(torch.float64)) @ turn.T + shift.to(torch.float64))


def refined(mesh: Mesh, times: int) -> Mesh:
    """Every face divided into four, ``times`` times: the same surface."""
    vertices, faces = mesh.vertices, mesh.faces
    for _ in range(times):
        vertices, faces = split_in_four(vertices, faces)
    return Mesh(vertices, faces)


def refined_on_one_side(mesh: Mesh, times: int) -> Mesh:
    """One side of a cube with faces divided into four, ``times`` times; the other five sides do not change."""
    # Faces 0 and 6 of a cube are the two halves of one side.
    vertices = mesh.vertices
    fine, coarse = mesh.faces[[0, 6]], mesh.faces[[1, 2, 3, 4, 5, 7, 8, 9, 10, 11]]
    for _ in range(times):
        vertices, fine = split_in_four(vertices, fine)
    return Mesh(vertices, torch.cat([fine, coarse]))


def displaced(mesh: Mesh, amplitude: float, wavelength: float) -> Mesh:
    """The mesh after a small smooth displacement along x, y and z, with a wave in each."""
    wave = torch.sin(2 * math.pi / wavelength * mesh.vertices.roll(1, dims=1))
    return mesh.with_vertices(mesh.vertices + amplitude * wave)


def measure_level(task: dict, config: dict) -> dict:
    """Exact values, edge length, and the errors of varifold, other quadrature rules and samples, by exponent."""
    family, d = task["family"], task["d"]
    normal_scale = config["families"][family]["normal_scale"] if d == 6 else 0.0
    meshes = pair_of_meshes(family, task["level"], config)
    truths = [continuous(mesh, normal_scale) for mesh in meshes]
    found = {
        "n_faces": len(meshes[0].faces),
        "edge": float(edge_lengths(meshes[0]).mean()),
        "exact": {},
        "atoms": {},
        "samples": {},
    }
    rules = ("barycentres",) if d == 6 else ("barycentres", "midpoints", "vertices")
    encoded = {rule: [atoms(mesh, rule, normal_scale) for mesh in meshes] for rule in rules}
    for p in config["exponents"]:
        rows = [_one_set(encoded, meshes, truths, k, task, p, normal_scale, config) for k in range(config["n_sets"])]
        found["exact"][str(p)] = short(np.mean([row["exact"] for row in rows]))
        for rule in rules:
            found["atoms"].setdefault(rule, {})[str(p)] = _lists([row[rule] for row in rows])
        found["samples"][str(p)] = _lists([pair for row in rows for pair in row["samples"]])
    return found


def _one_set(
    encoded: dict[str, list[DiscreteMeasure]],
    meshes: tuple[Mesh, Mesh],
    truths: list[SurfaceMeasure],
    k: int,
    task: dict,
    p: int,
    normal_scale: float,
    config: dict,
) -> dict:
    """For one set of directions: the exact SW_p^p, and for each encoding the error and SW_p to its own mesh."""
    directions = quasi_directions(config["n_directions"], task["d"], config["seed"] + k)
    exact = float(sliced_wasserstein(*truths, directions, p))
    row = {"exact": exact}
    for rule, pair in encoded.items():
        row[rule] = errors(pair, truths[0], exact, directions, p)
    n_faces = len(meshes[0].faces)
    generator = np.random.default_rng([config["seed"], k, n_faces, task["d"], p])
    row["samples"] = []
    for _ in range(config["n_draws"] if n_faces <= config["n_draws_up_to"] else 1):
        pair = [sample(mesh, n_faces, normal_scale, generator) for mesh in meshes]
        row["samples"].append(errors(pair, truths[0], exact, directions, p))
    return row


def errors(
    pair: list[DiscreteMeasure], own: SurfaceMeasure, exact: float, directions: Tensor, p: int
) -> tuple[float, float]:
    """Signed error of SW_p^p between two encoded meshes, and SW_p between the first and the mesh it encodes."""
    other = float(sliced_wasserstein(*pair, directions, p)) - exact
    return other, float(sliced_wasserstein(pair[0], own, directions, p)) ** (1 / p)


def _lists(pairs: list[tuple[float, float]]) -> dict[str, list[float]]:
    return {"other": [short(pair[0]) for pair in pairs], "own": [short(pair[1]) for pair in pairs]}


def measure_clock(task: dict, config: dict) -> dict:
    """SW₂² of positions between two surfaces by every method, with relative error and CPU seconds including encoding.

    All methods use the same directions, and the exact value of the full meshes is the reference. The first call of each
    method compiles it and is not timed.
    """
    settings = config["clock"]
    white = fsaverage5_surface("white", config["cortex"]["hemisphere"])
    if task["pair"] == "tiny deformation":
        pair = white, displaced(white, settings["amplitude"], settings["wavelength"])
    else:
        pair = white, fsaverage5_surface("pial", config["cortex"]["hemisphere"])
    directions = quasi_directions(settings["n_directions"], 3, config["seed"])
    truth = _exact(pair, directions)
    rows = []
    for way, size, value in ways(task["pair"], pair, directions, settings):
        value(0)
        seconds, errors = [], []
        for repeat in range(settings["n_repeats"]):
            before = time.process_time()
            found = value(repeat)
            seconds.append(time.process_time() - before)
            errors.append(found / truth - 1)
        rows.append(
            {
                "way": way,
                "size": size,
                "seconds": float(f"{statistics.median(seconds):.4g}"),
                "errors": [short(error) for error in errors],
            }
        )
    return {"truth": float(f"{truth:.10g}"), "rows": rows}


def ways(name: str, pair: tuple[Mesh, Mesh], directions: Tensor, settings: dict) -> list[tuple[str, int, Callable]]:
    """Name, number of support points, and a function from the index of the repetition to SW₂²."""
    found: list[tuple[str, int, Callable]] = [("exact", len(pair[0].faces), lambda _: _exact(pair, directions))]
    if name == "white to pial":
        for n_faces in settings["faces"]:
            coarse = tuple(decimated(mesh, n_faces) for mesh in pair)
            found.append(("exact on fewer faces", n_faces, lambda _, coarse=coarse: _exact(coarse, directions)))
            found.append(("varifold on fewer faces", n_faces, lambda _, coarse=coarse: _varifold(coarse, directions)))
    for times in settings["splits"]:
        fine = tuple(refined(mesh, times) for mesh in pair)
        found.append(("varifold", len(fine[0].faces), lambda _, fine=fine: _varifold(fine, directions)))
    for n_points in settings["samples"]:
        found.append(("samples", n_points, lambda k, n=n_points: _sampled(pair, n, (k, k + 1000), directions)))
        found.append(("samples, same draws", n_points, lambda k, n=n_points: _sampled(pair, n, (k, k), directions)))
    return found


def _exact(pair: tuple[Mesh, ...], directions: Tensor) -> float:
    return float(sliced_wasserstein(*(surface(mesh) for mesh in pair), directions))


def _varifold(pair: tuple[Mesh, ...], directions: Tensor) -> float:
    return _between([atoms(mesh, "barycentres", 0.0) for mesh in pair], directions)


def _sampled(pair: tuple[Mesh, ...], n_points: int, seeds: tuple[int, int], directions: Tensor) -> float:
    sides = [sample(mesh, n_points, 0.0, np.random.default_rng([7, s])) for mesh, s in zip(pair, seeds, strict=True)]
    return _between(sides, directions)


def _between(sides: list[DiscreteMeasure], directions: Tensor) -> float:
    return float(sliced_wasserstein(*sides, directions))


MEASURE = {"levels": measure_level, "clock": measure_clock}


def tasks(config: dict) -> list[dict]:
    """All levels of all families in both spaces, the fast ones first; the timing at the end."""
    found = [
        {"part": "levels", "family": family, "level": level, "d": d}
        for family, settings in config["families"].items()
        for level in settings["levels"]
        for d in (3, 6)
    ]
    largest = {"cortex_decimated": 1 / 320, "cortex_split": 2.0}
    found.sort(key=lambda task: task["level"] * largest.get(task["family"], 1.0))
    return found + [{"part": "clock", "pair": name} for name in ("white to pial", "tiny deformation")]


def work(task: dict, config: dict) -> dict:
    """One level, or the times of a pair."""
    return MEASURE[task["part"]](task, config)


def results(rows: list[dict], config: dict) -> dict:
    """The errors of all levels, and the times."""
    return summarise(rows, config) | {"clock": summarise_clock(rows)}


if __name__ == "__main__":
    experiment.run(__file__, tasks, work, results, "synthetic surfaces; FreeSurfer's fsaverage5, left hemisphere")
