"""Measure how fast plug-in estimates of W, of sliced Wasserstein and of Chamfer converge to their limits."""

import functools
import itertools
import json
import sys
import warnings
import zlib
from pathlib import Path

import numpy as np
import ot
import torch
from pairs import MESHES, draw_pair, known_distance, known_slices, translation
from scipy.spatial.distance import cdist

from meshot import DiscreteMeasure, chamfer, quasi_directions
from meshot.loss import slice_costs
from meshot.mesh import Mesh, cube, face_areas, face_barycentres, split_in_four
from meshot.metrics import Surface, SurfaceSample
from meshot_book.statistics import fitted_slope, short

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment


def chamfer_limit(pair: dict, config: dict) -> dict:
    """The pair with its limit, the method by which it is known, and for quadrature an estimate of its error.

    The limit is the mean squared distance from one support to the other, summed over both directions. It is zero if the
    supports are equal, for any masses on them.
    """
    relation = pair["relation"]
    if relation in ("equal", "other_density"):
        return pair | {"limit": 0.0, "known_by": "equal supports", "uncertainty": 0.0}
    if relation == "concentric":
        limit = 2 * (1 - config["inner_radius"]) ** 2
        return pair | {"limit": limit, "known_by": "closed form", "uncertainty": 0.0}
    if relation == "translated":
        return pair | {"limit": shifted_cubes(pair, config), "known_by": "closed form", "uncertainty": 0.0}
    source = cube() if pair["shape"] == "cube_surface" else MESHES[pair["shape"]]
    target = MESHES["sphere_mesh"]
    values = [one_way(source, target, n) + one_way(target, source, n) for n in config["limits"]["refinements"]]
    # The barycentre rule has an error of c·h²: two levels give the limit, a third its accuracy.
    limits = [(4 * fine - coarse) / 3 for coarse, fine in itertools.pairwise(values)]
    return pair | {"limit": limits[-1], "known_by": "quadrature", "uncertainty": abs(limits[-1] - limits[-2])}


def shifted_cubes(pair: dict, config: dict) -> float:
    """Chamfer between a unit cube and its translate by a in every coordinate, 0 ≤ a ≤ 1: 2 · d · a³/3.

    Along each axis a point at x < a has the distance a − x from the other cube, and ∫₀ᵃ (a − x)² dx = a³/3.
    """
    return 2 * float((translation(pair, config) ** 3 / 3).sum())


def one_way(source: Mesh, target: Mesh, refinement: int) -> float:
    """The mean over the source's area of the squared distance to the target's faces (libigl), by barycentres."""
    # Coarse faces are divided first, so that both sides have the same refinement.
    vertices, faces = source.vertices, source.faces
    while len(faces) < 1000:
        vertices, faces = split_in_four(vertices, faces)
    for _ in range(refinement - 2):
        vertices, faces = split_in_four(vertices, faces)
    fine = Mesh(vertices, faces)
    areas, places = face_areas(fine).numpy(), face_barycentres(fine).numpy()
    offsets = Surface(target).offsets(SurfaceSample(places, np.zeros_like(places)))
    return float((areas * offsets.distances**2).sum() / areas.sum())


#: The estimated quantities. W_p and SW_p are distances (roots taken); Chamfer is squared as in the paper.
MEASURES = ("transport", "sliced", "chamfer")


def errors(task: dict, limits: list[dict], config: dict) -> dict[str, list[float]]:
    """Signed errors of a task, one per repetition, by exponent (``"1"``, ``"2"``; Chamfer has only ``"2"``)."""
    pair = {name: task[name] for name in ("shape", "d", "relation")}
    measure = {"transport": _transport, "sliced": _sliced, "chamfer": _chamfer}[task["estimate"]]
    found = []
    for repetition in range(task["n_repetitions"]):
        # One random stream per repetition: W and SW use the same samples.
        name = zlib.crc32(json.dumps([pair, task["n_points"]], sort_keys=True).encode())
        stream = [config["seed"], repetition, name]
        sample = draw_pair(pair, task["n_points"], config, np.random.default_rng(stream))
        found.append(measure(pair, *sample, limits, config))
    return {p: [short(row[p]) for row in found] for p in found[0]}


def optimal_cost(points: np.ndarray, others: np.ndarray, p: int) -> float:
    """W_p^p between equally many points of equal mass, exactly (POT's network simplex).

    For p = 2, W₂² is the squared distance of the means plus W₂² of the centred points. The latter is solved several
    times faster if the measures are far apart.
    """
    apart = 0.0
    if p == 2:
        means = points.mean(axis=0), others.mean(axis=0)
        points, others, apart = points - means[0], others - means[1], float(np.sum((means[0] - means[1]) ** 2))
    cost = cdist(points, others, "sqeuclidean" if p == 2 else "euclidean")
    with warnings.catch_warnings():
        # A solver that stops early only warns: turn the warning into an error.
        warnings.simplefilter("error")
        return float(ot.emd2([], [], cost, numItermax=10**9)) + apart


def _transport(pair: dict, points: np.ndarray, others: np.ndarray, _: list, config: dict) -> dict[str, float]:
    found = {}
    for p in config["exponents"]:
        cost = optimal_cost(points, others, p)
        found[str(p)] = cost ** (1 / p) - known_distance(pair, config)
    return found


def _sliced(pair: dict, points: np.ndarray, others: np.ndarray, _: list, config: dict) -> dict[str, float]:
    directions = quasi_directions(config["sliced"]["n_directions"], pair["d"], config["seed"])
    source, target = (DiscreteMeasure(torch.from_numpy(side)) for side in (points, others))
    found = {}
    for p in config["exponents"]:
        cost = float(slice_costs(source, target, directions, p).mean())
        exact = float(known_slices(pair, config, directions.numpy(), p).mean())
        found[str(p)] = cost ** (1 / p) - exact ** (1 / p)
    return found


def _chamfer(pair: dict, points: np.ndarray, others: np.ndarray, limits: list, _: dict) -> dict[str, float]:
    (limit,) = [row["limit"] for row in limits if all(row[name] == value for name, value in pair.items())]
    source, target = (DiscreteMeasure(torch.from_numpy(side)) for side in (points, others))
    return {"2": float(chamfer(source, target)) - limit}


#: Shapes whose intrinsic dimension is that of the space.
SOLID = ("cube", "two_cubes")


def summarise(rows: list[dict], config: dict) -> dict:
    """For every estimator, pair and exponent the mean absolute errors over sizes, and the fitted slope."""
    groups: dict[tuple, list[dict]] = {}
    for row in rows:
        task = row["task"]
        for p in row["values"]:
            groups.setdefault((task["estimate"], task["shape"], task["d"], task["relation"], p), []).append(row)
    results: dict[str, list] = {"transport": [], "sliced": [], "chamfer": []}
    for (estimate, shape, d, relation, p), group in groups.items():
        pair = {"shape": shape, "d": d, "relation": relation}
        group = sorted(group, key=lambda row: row["task"]["n_points"])
        sizes = [row["task"]["n_points"] for row in group]
        errors = [np.array(row["values"][p]) for row in group]
        first = sizes.index(config[estimate]["fit_from"])
        slope, low, high = fitted_slope(sizes[first:], errors[first:])
        row = pair | {
            "p": int(p),
            "dimension": intrinsic_dimension(pair),
            "sizes": sizes,
            "n_repetitions": [len(values) for values in errors],
            "error": [short(np.abs(values).mean()) for values in errors],
            "error_sd": [short(np.abs(values).std(ddof=1)) for values in errors],
            "bias": [short(values.mean()) for values in errors],
            "slope": short(slope),
            "low": short(low),
            "high": short(high),
            "expected": expected_slope(estimate, pair, int(p)),
        }
        results[estimate].append(row)
    return results


def intrinsic_dimension(pair: dict) -> int:
    """2 for a surface, the dimension of the space for a solid."""
    return pair["d"] if pair["shape"] in SOLID else 2


def expected_slope(estimate: str, pair: dict, p: int) -> float | None:
    """The exponent according to theory, without logarithms; None if no statement is known.

    Equal measures of intrinsic dimension k: W_p has an error of m^(-1/max(k, 2)), and of m^(-1/(2p)) if the support is
    disconnected and that is larger. Different measures, p = 2: a bias of m^(-2/k) from matching and noise of m^(-1/2),
    unless the potential is constant by symmetry. Chamfer: squared distances to the nearest sample, m^(-2/k), and the
    same noise.
    """
    k, relation = intrinsic_dimension(pair), pair["relation"]
    if estimate == "sliced":
        split = relation == "equal" and p == 2 and pair["shape"] == "two_cubes"
        return None if split or relation == "concentric" or pair["shape"] == "cube_surface" else -0.5
    if estimate == "chamfer":
        noisy = relation in ("translated", "other_surface")
        return round(max(-2 / k, -0.5) if noisy else -2 / k, 4)
    if relation == "equal":
        pieces = pair["shape"] in ("two_cubes", "cube_surface")
        return round(max(-1 / max(k, 2), -1 / (2 * p) if pieces else -1), 4)
    if relation == "concentric":
        return round(-2 / k, 4)
    return round(max(-2 / k, -0.5), 4) if p == 2 else None


def tasks(config: dict) -> list[dict]:
    """All combinations of estimator, pair and size, the slow ones last."""
    found = []
    for estimate in MEASURES:
        settings = config[estimate]
        for pair in settings.get("pairs", config["pairs"]):
            for n_points, n_repetitions in zip(settings["sizes"], settings["repetitions"], strict=True):
                found.append({"estimate": estimate, **pair, "n_points": n_points, "n_repetitions": n_repetitions})
    return sorted(found, key=lambda task: task["n_points"])


@functools.cache
def limits(config: dict) -> list[dict]:
    """The limits of Chamfer without a closed form, and those with one."""
    return [chamfer_limit(pair, config) for pair in config["chamfer"]["pairs"]]


def work(task: dict, config: dict) -> list:
    """The errors of the repetitions of a task."""
    return errors(task, limits(config), config)


def results(rows: list[dict], config: dict) -> dict:
    """The errors over the size, and the limits."""
    return summarise([row | {"values": row["found"]} for row in rows], config) | {"limits": limits(config)}


if __name__ == "__main__":
    experiment.run(__file__, tasks, work, results, "synthetic clouds and surfaces with known distances")
