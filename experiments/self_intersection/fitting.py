"""One fit of a sphere to a folded sphere, under a loss on an encoding, by free vertices or by a flow."""

from collections.abc import Callable

import numpy as np
import torch
from scipy.spatial.transform import Rotation

from meshot import DiscreteMeasure, Mesh, chamfer, varifold
from meshot.flow import (
    FitLoss,
    FitSettings,
    GridVelocity,
    crossings_along,
    fit_flow,
    grid_around,
    inspect_paths,
    sliced_loss,
)
from meshot.mesh import face_corners, folded_sphere, icosphere, self_intersecting_faces
from meshot.metrics import Surface, average_surface_distance


def turned_sphere(task: dict, config: dict, level: int | None = None) -> Mesh:
    """The start, or another resolution of it: an icosphere, rotated and shifted by the seed."""
    pair = config["pairs"][task["pair"]]
    turns, shift = _placement(task["seed"], pair["offset"])
    sphere = icosphere(pair["level"] if level is None else level, pair["radius"])
    return sphere.with_vertices(sphere.vertices @ turns[0].T + shift)


def folded_target(task: dict, config: dict) -> Mesh:
    """The folded sphere, with another rotation by the seed."""
    pair = config["pairs"][task["pair"]]
    turns, _ = _placement(task["seed"], pair["offset"])
    target = folded_sphere(pair["level"], pair["radius"], pair["depth"], pair["n_folds"])
    return target.with_vertices(target.vertices @ turns[1].T)


def _placement(seed: int, distance: float) -> tuple[list[torch.Tensor], torch.Tensor]:
    generator = np.random.default_rng([seed, 0])
    turns = [torch.from_numpy(Rotation.random(rng=generator).as_matrix()) for _ in range(2)]
    offset = torch.from_numpy(generator.normal(size=3))
    return turns, distance * offset / offset.norm()


def make_encoding(name: str, config: dict) -> Callable[[Mesh], DiscreteMeasure]:
    """Varifolds, or the barycentres of the faces, weighted by their areas."""
    if name == "varifold":
        return lambda mesh: varifold(mesh, normal_scale=config["fits"]["normal_scale"])

    def barycentres(mesh: Mesh) -> DiscreteMeasure:
        return DiscreteMeasure(face_corners(mesh).mean(dim=1), varifold(mesh).weights)

    return barycentres


def make_loss(loss: str, encoding: str, target: Mesh, config: dict) -> FitLoss:
    """The loss of a row, with p = 2."""
    encode = make_encoding(encoding, config)
    if loss == "sliced":
        return sliced_loss(target, encode)
    goal = encode(target)
    return lambda mesh, n_directions, generator: chamfer(encode(mesh), goal)


def fitted_flow(task: dict, config: dict) -> GridVelocity:
    """The field whose flow moves the sphere of the task's seed to its target."""
    fits = config["fits"]
    start, target = turned_sphere(task, config), folded_target(task, config)
    spacings = [fits["coarsest"]]
    while spacings[-1] > task["spacing"]:
        spacings.append(spacings[-1] / 2)
    box = (start.vertices, target.vertices)
    field = grid_around(*box, margin=fits["margin"], spacings=tuple(spacings), n_pieces=fits["n_pieces"])
    settings = FitSettings(
        n_iterations=fits["n_iterations"],
        learning_rate=fits["learning_rate"],
        n_steps=fits["n_steps"],
        n_directions=(fits["n_directions"],) * 2,
        check_every=50,
        seed=task["seed"],
    )
    return fit_flow(field, start, make_loss(task["loss"], task["encoding"], target, config), settings).field


def free_fit(task: dict, config: dict) -> Mesh:
    """The mesh after a fit of free vertices by Adam, with the same number of iterations and learning rate."""
    fits, seed = config["fits"], task["seed"]
    start, target = turned_sphere(task, config), folded_target(task, config)
    loss = make_loss(task["loss"], task["encoding"], target, config)
    moving = start.vertices.clone().requires_grad_()
    optimiser = torch.optim.Adam([moving], lr=fits["learning_rate"])
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, fits["n_iterations"])
    for i in range(fits["n_iterations"]):
        optimiser.zero_grad()
        loss(start.with_vertices(moving), fits["n_directions"], np.random.default_rng([seed, i])).backward()
        optimiser.step()
        schedule.step()
    return start.with_vertices(moving.detach())


def fit_row(task: dict, config: dict) -> dict[str, float]:
    """One fit, with the self-intersections at the end and along the flow, and the diagnosis of its paths."""
    target = folded_target(task, config)
    if not task["spacing"]:
        mesh = free_fit(task, config)
        crossing = len(self_intersecting_faces(mesh))
        return {"crossing": crossing, "assd": assd(mesh, target, config)}
    field, n_steps = fitted_flow(task, config), config["fits"]["n_steps"]
    start = turned_sphere(task, config)
    report, along = inspect_paths(field, start.vertices, n_steps), crossings_along(field, start, n_steps)
    return {
        "crossing": along[-1],
        "most_on_the_way": max(along),
        "assd": assd(start.with_vertices(report.positions[-1]), target, config),
        "lipschitz": report.steepest,
        "step_times_lipschitz": report.step_times_lipschitz,
        "flips": report.n_flips,
    }


def assd(mesh: Mesh, target: Mesh, config: dict) -> float:
    """The average symmetric surface distance in mm, to the faces."""
    surfaces = Surface(mesh), Surface(target)
    n_points = config["fits"]["n_points"]
    samples = [s.sample(n_points, np.random.default_rng([9, k])) for k, s in enumerate(surfaces)]
    return average_surface_distance(surfaces[1].offsets(samples[0]), surfaces[0].offsets(samples[1]))
