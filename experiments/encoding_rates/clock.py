"""Error over time for one pair of cortical surfaces: the exact value, varifolds and samples."""

import statistics
import time
from collections.abc import Callable

import numpy as np
from families import displaced, refined
from stand_ins import atoms, sample

from meshot import DiscreteMeasure, Mesh, quasi_directions, sliced_wasserstein, surface
from meshot.anatomy import fsaverage5_surface
from meshot.mesh import decimated
from meshot.types import Tensor


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
                "errors": [float(f"{error:.6g}") for error in errors],
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
