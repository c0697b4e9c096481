"""The errors of all encodings of one pair of meshes at one level, for each set of directions."""

import numpy as np
from families import pair_of_meshes
from stand_ins import atoms, continuous, sample

from meshot import DiscreteMeasure, Mesh, SurfaceMeasure, quasi_directions, sliced_wasserstein
from meshot.mesh import edge_lengths
from meshot.types import Tensor


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
        found["exact"][str(p)] = _short(np.mean([row["exact"] for row in rows]))
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
    return {"other": [_short(pair[0]) for pair in pairs], "own": [_short(pair[1]) for pair in pairs]}


def _short(value: float) -> float:
    return float(f"{value:.6g}")
