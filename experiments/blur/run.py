"""Compare Sinkhorn divergences of several blurs with sliced Wasserstein, and measure the limits of the divergence."""

import json
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import ot
import torch
from scipy.spatial.transform import Rotation

from meshot import (
    DiscreteMeasure,
    Mesh,
    quasi_directions,
    random_directions,
    sinkhorn_divergence,
    sliced_wasserstein,
    surface,
    varifold,
    wasserstein,
)
from meshot.mesh import face_areas, folded_sphere, icosphere, sample_points
from meshot.metrics import Surface, average_surface_distance, earth_movers_distance
from meshot.provenance import rounded
from meshot.types import Array, Tensor
from meshot_book.statistics import arm_differences

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment

VarifoldLoss = Callable[[DiscreteMeasure], torch.Tensor]


def make_pair(seed: int, config: dict) -> tuple[Mesh, Mesh]:
    """Start and target with random rotations, so that vertices do not correspond; the start is off the centre."""
    generator = np.random.default_rng([seed, 0])
    turns = [torch.from_numpy(Rotation.random(rng=generator).as_matrix()) for _ in range(2)]
    offset = torch.from_numpy(generator.normal(size=3))
    offset = config["start_offset_mm"] * offset / offset.norm()
    start = icosphere(config["subdivisions"], config["radius_mm"])
    shape = (config["subdivisions"], config["radius_mm"], config["fold_depth_mm"], config["n_folds"])
    target = folded_sphere(*shape)
    return start.with_vertices(start.vertices @ turns[0].T + offset), target.with_vertices(target.vertices @ turns[1].T)


def make_loss(run: dict, target: DiscreteMeasure, seed: int, config: dict) -> VarifoldLoss:
    """The loss of a row of the configuration, with p = 2 and the package's defaults."""
    if run["loss"] == "exact":
        return lambda measure: wasserstein(measure, target)
    if run["loss"] == "sinkhorn":
        return lambda measure: sinkhorn_divergence(measure, target, blur=run["blur_mm"], scaling=run["scaling"])
    generator = np.random.default_rng([seed, 1])
    return lambda measure: sliced_wasserstein(measure, target, random_directions(config["n_directions"], 6, generator))


def fit(run: dict, seed: int, config: dict) -> Mesh:
    """The mesh after Adam on free vertices. The result does not depend on the scale of the loss."""
    start, target = make_pair(seed, config)
    scale = config["normal_scale_mm"]
    loss = make_loss(run, varifold(target, normal_scale=scale), seed, config)
    moving = start.vertices.clone().requires_grad_()
    optimiser = torch.optim.Adam([moving], lr=config["learning_rate_mm"])
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, config["n_steps"])
    for _ in range(config["n_steps"]):
        optimiser.zero_grad()
        loss(varifold(start.with_vertices(moving), normal_scale=scale)).backward()
        optimiser.step()
        schedule.step()
    return start.with_vertices(moving.detach())


def judged(mesh: Mesh, target: Mesh, config: dict) -> dict[str, float]:
    """Distances from the mesh to the target in mm: two transport distances without sampling, two metrics with it."""
    scale, n_emd = config["normal_scale_mm"], config["n_emd_points"]
    directions = quasi_directions(config["n_judge_directions"], 3)
    surfaces = Surface(mesh), Surface(target)
    samples = [s.sample(config["n_surface_points"], np.random.default_rng([9, k])) for k, s in enumerate(surfaces)]
    points = [sample_points(m, n_emd, np.random.default_rng([8, k])).numpy() for k, m in enumerate((mesh, target))]
    return {
        "w2_varifold": exact_distance(varifold(mesh, normal_scale=scale), varifold(target, normal_scale=scale)),
        "sw2_surface": float(sliced_wasserstein(surface(mesh), surface(target), directions)) ** 0.5,
        "assd": average_surface_distance(surfaces[1].offsets(samples[0]), surfaces[0].offsets(samples[1])),
        "emd": earth_movers_distance(*points),
    }


def exact_distance(source: DiscreteMeasure, target: DiscreteMeasure) -> float:
    """W₂ by POT, in NumPy, without code of the losses."""
    cost = ot.dist(source.points.numpy(), target.points.numpy())
    return float(np.sqrt(ot.emd2(source.weights.numpy(), target.weights.numpy(), cost, numItermax=10_000_000)))


def run_once(run: dict, seed: int, config: dict) -> dict[str, float]:
    """One fit and its evaluation."""
    return judged(fit(run, seed, config), make_pair(seed, config)[1], config)


def limit_rows(config: dict) -> list[dict]:
    """Value and gradient over the blur, for both exponents and several scalings, at one start and target."""
    start, target = make_pair(config["seeds"][0], config)
    scale = config["normal_scale_mm"]
    measures = varifold(start, normal_scale=scale), varifold(target, normal_scale=scale)
    rows = []
    for p in config["limits"]["exponents"]:
        exact, energy = exact_cost(*measures, p), energy_distance(*measures, p)
        transport_gradient = vertex_gradient(start, lambda m, p=p: wasserstein(m, measures[1], p), scale)
        for scaling in config["limits"]["scalings"]:
            for blur in config["limits"]["blurs_mm"]:
                settings = {"p": p, "blur": blur, "scaling": scaling}
                value = float(sinkhorn_divergence(*measures, **settings))
                gradient = vertex_gradient(start, lambda m, s=settings: sinkhorn_divergence(m, measures[1], **s), scale)
                rows.append(
                    settings
                    | {"value": value, "exact": exact, "energy": energy}
                    | {"off_exact": value / exact - 1, "off_energy": value / energy - 1}
                    | {"cosine_to_exact": _cosine(gradient, transport_gradient), "uniformity": _uniformity(gradient)}
                )
    return rows


def exact_cost(source: DiscreteMeasure, target: DiscreteMeasure, p: int) -> float:
    """W_p^p by POT."""
    cost = ot.dist(source.points.numpy(), target.points.numpy(), metric="euclidean") ** p
    return float(ot.emd2(source.weights.numpy(), target.weights.numpy(), cost, numItermax=10_000_000))


def energy_distance(source: DiscreteMeasure, target: DiscreteMeasure, p: int) -> float:
    """E|X − Y|^p − ½ E|X − X'|^p − ½ E|Y − Y'|^p. For p = 2 this is the squared distance between the two means."""

    def mean_cost(a: DiscreteMeasure, b: DiscreteMeasure) -> float:
        cost = ot.dist(a.points.numpy(), b.points.numpy(), metric="euclidean") ** p
        return float(a.weights.numpy() @ cost @ b.weights.numpy())

    return mean_cost(source, target) - (mean_cost(source, source) + mean_cost(target, target)) / 2


def vertex_gradient(mesh: Mesh, loss: object, normal_scale: float) -> Array:
    """The gradient of a loss between varifolds in barycentres and normals of the moving side, per unit of mass."""
    measure = varifold(mesh, normal_scale=normal_scale)
    points = measure.points.detach().clone().requires_grad_()
    (gradient,) = torch.autograd.grad(loss(DiscreteMeasure(points, measure.weights)), points)
    return _per_mass(gradient, measure.weights)


def _per_mass(gradient: Tensor, weights: Tensor) -> Array:
    return (gradient / weights[:, None]).numpy()


def _cosine(a: Array, b: Array) -> float:
    return float((a * b).sum() / np.sqrt((a * a).sum() * (b * b).sum()))


def _uniformity(gradient: Array) -> float:
    """|mean gradient|² / mean |gradient|²: one if the gradient is the same at every face, that is, a translation."""
    return float(np.square(gradient.mean(axis=0)).sum() / np.square(gradient).sum(axis=1).mean())


MEASURED = ("w2_varifold", "sw2_surface", "assd", "emd")


def summarise(rows: list[dict]) -> dict[str, list[dict]]:
    """Means and deviations over seeds for each loss, and its paired difference from sliced Wasserstein (95 %)."""
    groups: dict[str, list[dict]] = {}
    for row in rows:
        groups.setdefault(json.dumps(row["run"]), []).append(row)
    fits = []
    for group in groups.values():
        values = {f"{name}_seeds": [row["values"][name] for row in group] for name in MEASURED}
        means = {f"{name}_mean": float(np.mean(values[f"{name}_seeds"])) for name in MEASURED}
        spread = {f"{name}_sd": float(np.std(values[f"{name}_seeds"], ddof=1)) for name in MEASURED}
        fits.append(group[0]["run"] | means | spread | values | {"n_seeds": len(group)})
    sliced = next(row for row in fits if row["loss"] == "sliced")
    return {"fits": fits, "differences": [_difference(row, sliced) for row in fits if row is not sliced]}


def _difference(row: dict, sliced: dict) -> dict:
    found = {key: value for key, value in row.items() if key in ("loss", "blur_mm", "scaling")}
    arms = ({name: arm[f"{name}_seeds"] for name in MEASURED} for arm in (row, sliced))
    return found | arm_differences(*arms, centre="mean")


def yardsticks(config: dict) -> dict:
    """Reference values in mm: the metrics of the start and of a perfect fit, and lengths to compare a blur with."""
    pairs = [make_pair(seed, config) for seed in config["seeds"]]
    starts = [judged(start, target, config) for start, target in pairs]
    perfect = [judged(target, target, config) for _, target in pairs[:1]]
    target = pairs[0][1]
    widest = float(torch.cdist(target.vertices, target.vertices).max())
    spacing = float(face_areas(target).sum() / len(target.faces)) ** 0.5
    return {
        "start": {name: float(np.mean([row[name] for row in starts])) for name in MEASURED},
        "floor": perfect[0],
        "lengths_mm": {"diameter": widest, "spacing": spacing, "n_supports": len(target.faces)},
    }


def tasks(config: dict) -> list[tuple[dict, int]]:
    """All losses and seeds."""
    return [(run, seed) for seed in config["seeds"] for run in config["losses"]]


def results(rows: list[dict], config: dict) -> dict:
    """The fits, the limits of the divergence, and what they are compared with."""
    fits = [{"run": row["task"][0], "seed": row["task"][1], "values": row["found"]} for row in rows]
    return rounded(summarise(fits) | {"limits": limit_rows(config)} | yardsticks(config))


if __name__ == "__main__":
    experiment.run(__file__, tasks, lambda task, config: run_once(*task, config), results, "synthetic folded spheres")
