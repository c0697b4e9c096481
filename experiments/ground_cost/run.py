"""Compare the Euclidean ground cost with the sum of p-th powers that the paper writes."""

import math
import sys
from pathlib import Path

import numpy as np
import ot
import scipy.optimize
import torch
from scipy.spatial.transform import Rotation

from meshot import DiscreteMeasure, chamfer, quasi_directions, sinkhorn_divergence, sliced_wasserstein, wasserstein
from meshot.mesh import ellipsoid, folded_sphere, sample_points
from meshot.metrics import earth_movers_distance, sliced_distance
from meshot.provenance import rounded
from meshot.types import Array

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment

EUCLIDEAN, COORDINATES = "euclidean", "coordinates"


def cost_matrix(points: Array, others: Array, p: float, cost: str) -> Array:
    """‖x − y‖₂^p, or Σₖ |xₖ − yₖ|^p."""
    gaps = np.abs(points[:, None] - others[None])
    return np.square(gaps).sum(axis=2) ** (p / 2) if cost == EUCLIDEAN else (gaps**p).sum(axis=2)


def two_surfaces(seed: int, config: dict) -> tuple[Array, Array]:
    """Equally many points of a folded sphere and of an ellipsoid, in mm."""
    level, radius = config["subdivisions"], config["radius_mm"]
    meshes = (
        folded_sphere(level, radius, config["fold_depth_mm"], config["n_folds"]),
        ellipsoid(level, tuple(config["radii_mm"])),
    )
    generators = (np.random.default_rng([seed, k]) for k in range(2))
    first, second = (sample_points(m, config["n_points"], g).numpy() for m, g in zip(meshes, generators, strict=True))
    return first, second


def transport_row(seed: int, p: float, config: dict) -> dict[str, float]:
    """Differences between the two costs for two surfaces: value, plan, descent direction, change under rotation."""
    points, others = two_surfaces(seed, config)
    costs = {cost: cost_matrix(points, others, p, cost) for cost in (EUCLIDEAN, COORDINATES)}
    partners = {cost: scipy.optimize.linear_sum_assignment(matrix)[1] for cost, matrix in costs.items()}
    each = np.arange(len(points))
    values = {cost: float(matrix[each, partners[cost]].mean()) for cost, matrix in costs.items()}
    wrong_plan = float(costs[EUCLIDEAN][each, partners[COORDINATES]].mean())
    descents = {cost: _descent_direction(points, others[partners[cost]], p, cost) for cost in costs}
    cosines = (descents[EUCLIDEAN] * descents[COORDINATES]).sum(axis=1)
    return {
        "euclidean_root_mm": values[EUCLIDEAN] ** (1 / p),
        "coordinates_root_mm": values[COORDINATES] ** (1 / p),
        "ratio": values[COORDINATES] / values[EUCLIDEAN],
        "other_partner": float((partners[EUCLIDEAN] != partners[COORDINATES]).mean()),
        "lost_by_other_plan": wrong_plan / values[EUCLIDEAN] - 1,
        "mean_angle_degrees": float(np.degrees(np.arccos(np.clip(cosines, -1, 1))).mean()),
        **_turned(points, others, p, config, seed),
    }


def _descent_direction(points: Array, partners: Array, p: float, cost: str) -> Array:
    """Unit vectors along minus the gradient of each pair's cost in the first point."""
    gaps = partners - points
    raw = gaps if cost == EUCLIDEAN else np.sign(gaps) * np.abs(gaps) ** (p - 1)
    return raw / np.linalg.norm(raw, axis=1, keepdims=True)


def _turned(points: Array, others: Array, p: float, config: dict, seed: int) -> dict[str, float]:
    """The spread (largest over smallest, minus one) of each cost's root under rotations of both surfaces."""
    turns = Rotation.random(config["n_turns"], rng=np.random.default_rng([seed, 2])).as_matrix()
    masses = np.full(len(points), 1 / len(points))
    found = {}
    for cost in (EUCLIDEAN, COORDINATES):
        matrices = [cost_matrix(points @ turn.T, others @ turn.T, p, cost) for turn in turns]
        roots = [ot.emd2(masses, masses, matrix, numItermax=10_000_000) ** (1 / p) for matrix in matrices]
        found[f"turning_{cost}"] = float(max(roots) / min(roots) - 1)
    return found


def minimiser_row(seed: int, p: float, config: dict) -> dict[str, float]:
    """The position with the smallest mean cost to a third of a surface, for each cost, and the distance of the two."""
    points, _ = two_surfaces(seed, config)
    axis = Rotation.random(rng=np.random.default_rng([seed, 3])).as_matrix()[0]
    cap = points[points @ axis > np.quantile(points @ axis, 2 / 3)]
    places = {}
    for cost in (EUCLIDEAN, COORDINATES):
        start = cap.mean(axis=0)
        found = scipy.optimize.minimize(
            lambda x, c=cost: cost_matrix(x[None], cap, p, c).mean(),
            start,
            method="Nelder-Mead",
            options={"xatol": 1e-7, "fatol": 1e-10, "maxiter": 20_000, "maxfev": 20_000},
        )
        places[cost] = found.x
    return {"minimisers_apart_mm": float(np.linalg.norm(places[EUCLIDEAN] - places[COORDINATES]))}


def sliced_rows(config: dict) -> list[dict]:
    """Sliced costs of a step along an axis and along a diagonal, compared with E|⟨θ, z⟩|^p = c ‖z‖₂^p."""
    directions, rows = quasi_directions(config["n_directions"], 3), []
    for p in config["exponents"]:
        # E|θ₁|^p of a uniform direction in R^d.
        constant = math.gamma(3 / 2) * math.gamma((p + 1) / 2) / (math.gamma((3 + p) / 2) * math.sqrt(math.pi))
        for name, step in two_steps(config).items():
            pair = (
                DiscreteMeasure(torch.zeros(1, 3, dtype=torch.float64)),
                DiscreteMeasure(torch.from_numpy(step)[None]),
            )
            value = float(sliced_wasserstein(*pair, directions, p))
            both = {cost: float(cost_matrix(np.zeros((1, 3)), step[None], p, cost)[0, 0]) for cost in
                    (EUCLIDEAN, COORDINATES)}  # fmt: skip
            ratios = {f"over_{cost}": value / both[cost] for cost in both}
            rows.append({"p": p, "step": name, "value": value, "constant": constant} | ratios)
    return rows


def two_steps(config: dict) -> dict[str, Array]:
    """A step along the first axis and one of the same length along the diagonal."""
    length = config["step_mm"]
    return {"axis": np.array([length, 0.0, 0.0]), "diagonal": np.full(3, length / math.sqrt(3))}


def asked_rows(config: dict) -> list[dict]:
    """The value of each loss and metric for two single points, which shows its ground cost.

    ‖z‖₂^p depends only on the Euclidean length of a step. Σ|zₖ|^p also depends on the direction, unless p = 2.
    """
    directions = quasi_directions(config["n_directions"], 3)
    losses = {("chamfer", 2): chamfer}
    for p in config["exponents"]:
        losses["wasserstein", p] = lambda a, b, p=p: wasserstein(a, b, p)
        losses["sliced_wasserstein", p] = lambda a, b, p=p: sliced_wasserstein(a, b, directions, p)
        if p in (1, 2):
            losses["sinkhorn_divergence", p] = lambda a, b, p=p: sinkhorn_divergence(a, b, p)
    losses["evaluate: EMD", 2] = lambda a, b: earth_movers_distance(a.points.numpy(), b.points.numpy()) ** 2
    losses["evaluate: SWD", 2] = lambda a, b: sliced_distance(a.points.numpy(), b.points.numpy()) ** 2
    length, rows = config["step_mm"], []
    for (name, p), loss in losses.items():
        here = DiscreteMeasure(torch.zeros(1, 3, dtype=torch.float64))
        found = {
            way: float(loss(here, DiscreteMeasure(torch.from_numpy(step)[None])))
            for way, step in two_steps(config).items()
        }
        rows.append(
            {"loss": name, "p": p, "axis_over_step": found["axis"] / length**p}
            | {"diagonal_over_axis": found["diagonal"] / found["axis"], "coordinates_would_say": 3 ** (1 - p / 2)}
        )
    return rows


def tasks(config: dict) -> list[tuple[float, int]]:
    """All exponents and seeds."""
    return [(p, seed) for p in config["exponents"] for seed in config["seeds"]]


def row_of(task: tuple[float, int], config: dict) -> dict:
    """All measurements for one exponent and one seed."""
    p, seed = task
    return {"p": p, "seed": seed} | transport_row(seed, p, config) | minimiser_row(seed, p, config)


def summarise(rows: list[dict], config: dict) -> dict:
    """Mean and standard deviation over seeds of all measurements, for every exponent; and what needs no seed."""
    rows, found = [row["found"] for row in rows], []
    for p in dict.fromkeys(row["p"] for row in rows):
        group = [row for row in rows if row["p"] == p]
        names = [name for name in group[0] if name not in ("p", "seed")]
        means = {f"{name}_mean": float(np.mean([row[name] for row in group])) for name in names}
        spread = {f"{name}_sd": float(np.std([row[name] for row in group], ddof=1)) for name in names}
        found.append({"p": p} | means | spread | {"n_seeds": len(group)})
    return rounded({"summary": found, "sliced": sliced_rows(config), "asked": asked_rows(config)})


if __name__ == "__main__":
    experiment.run(__file__, tasks, row_of, summarise, "synthetic surfaces")
