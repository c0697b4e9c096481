"""One fit of the vertices of a sphere under a loss between varifolds, and its evaluation by independent metrics."""

from collections.abc import Callable

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
from meshot.mesh import folded_sphere, icosphere, sample_points
from meshot.metrics import Surface, average_surface_distance, earth_movers_distance

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
