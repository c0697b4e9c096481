"""Count self-intersecting faces: given flows, fits by flows and by free vertices, fitted flows with other integrations.

``results`` has four tables, without times, computed on one thread:

- ``given``: vortex (``strength`` is its Lipschitz constant) × ``level`` of the icosphere; ``rows`` by integration.
- ``fits``: ``pair`` × ``loss`` × ``encoding`` × ``spacing`` of the finest grid (0: free vertices) × ``seed``;
  self-intersecting faces at the end and the maximum along the flow, ASSD in mm, local Lipschitz constant along the
  paths, flips.
- ``carried``: arm × ``seed``; ``rows`` by factor and integration, each with ``levels``: self-intersecting faces at the
  end and the maximum along the flow.
- ``differences``: paired over seeds, with 95 % intervals: the effect of the loss, and the effect of the flow.
"""

import itertools
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
from scipy.spatial.transform import Rotation

from meshot import DiscreteMeasure, Mesh, chamfer, varifold
from meshot.flow import (
    FitLoss,
    FitSettings,
    GridVelocity,
    Velocity,
    crossings_along,
    fit_flow,
    grid_around,
    inspect_paths,
    integrate,
    sliced_loss,
    trajectory,
)
from meshot.mesh import face_corners, folded_sphere, icosphere, self_intersecting_faces
from meshot.metrics import Surface, average_surface_distance
from meshot.provenance import rounded
from meshot.statistics import paired_interval
from meshot_book.flows import Vortex

sys.path.append(str(Path(__file__).resolve().parents[1]))
import experiment


def ways(config: dict) -> list[tuple[str, int]]:
    """All combinations of method and number of steps."""
    return [("euler", n) for n in config["steps"]] + [("rk4", config["rk4_steps"])]


def count(mesh: Mesh, vertices: torch.Tensor) -> int:
    """The number of self-intersecting faces of the mesh with other vertices."""
    return len(self_intersecting_faces(mesh.with_vertices(vertices)))


def given_row(task: dict, config: dict) -> list[dict]:
    """One vortex and one resolution: self-intersecting faces for every integration, and for the exact flow."""
    given = config["given"]
    field = Vortex(task["strength"], given["offset"])
    mesh = icosphere(task["level"], given["sphere_radius"], (given["offset"], 0.0, 0.0))
    looked = icosphere(given["inspected_level"], given["sphere_radius"], (given["offset"], 0.0, 0.0)).vertices
    rows = [{"way": "exact", "steps": 0, "crossing": count(mesh, field.flow(mesh.vertices)), "flips": 0}]
    for method, n_steps in ways(config):
        moved = integrate(field, mesh.vertices, n_steps, method)
        flips = inspect_paths(field, looked, n_steps, method).n_flips
        rows.append({"way": method, "steps": n_steps, "crossing": count(mesh, moved), "flips": flips})
    return rows


def carried_row(task: dict, config: dict) -> list[dict]:
    """One fitted field times each factor: local Lipschitz constants, flips, and intersections by resolution."""
    carried, field = config["carried"], fitted_flow(task, config)
    looked = turned_sphere(task, config, carried["inspected_level"]).vertices
    rows = []
    for factor in carried["factors"]:
        velocity = scaled(field.prepared(), factor)
        reports = [(*way, inspect_paths(velocity, looked, way[1], way[0])) for way in ways(config)]
        for method, n_steps, report in reports:
            row = {"factor": factor, "way": method, "steps": n_steps, "flips": report.n_flips}
            row |= {"lipschitz": report.steepest, "step_times_lipschitz": report.step_times_lipschitz}
            rows.append(row | {"levels": crossing_by_level(velocity, method, n_steps, task, config)})
    return rows


def scaled(velocity: Velocity, factor: float) -> Velocity:
    """The field times a factor, which also multiplies its Lipschitz constant."""
    return lambda time, points: factor * velocity(time, points)


@torch.no_grad()
def crossing_by_level(
    velocity: Velocity, method: str, n_steps: int, task: dict, config: dict
) -> dict[str, dict[str, int]]:
    """For each resolution: self-intersecting faces at the end, and the maximum at a few earlier times."""
    found = {}
    for level in config["carried"]["levels"]:
        mesh = turned_sphere(task, config, level)
        places = trajectory(velocity, mesh.vertices, n_steps, method)
        looks = torch.linspace(0, n_steps, config["carried"]["n_looks"] + 1).round().long().unique().tolist()
        along = [count(mesh, places[k]) for k in looks]
        found[str(level)] = {"end": along[-1], "most": max(along)}
    return found


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


def differences(fits: list[dict]) -> list[dict]:
    """The effect of the loss for each grid spacing, and of the flow for each loss: means with 95 % intervals.

    ``change`` is "loss" (Chamfer minus sliced) or "flow" (free vertices minus the flow of that spacing).
    """
    counts: dict[tuple, list[int]] = {}
    for row in sorted(fits, key=lambda row: row["seed"]):
        key = (row["pair"], row["loss"], row["encoding"], row["spacing"])
        counts.setdefault(key, []).append(row["crossing"])
    found = []
    for (pair, loss, encoding, spacing), crossing in counts.items():
        row = {"pair": pair, "encoding": encoding, "spacing": spacing}
        if loss == "chamfer" and (pair, "sliced", encoding, spacing) in counts:
            rival = counts[pair, "sliced", encoding, spacing]
            found.append({"change": "loss"} | row | paired(crossing, rival))
        if spacing:
            free = counts[pair, loss, encoding, 0.0]
            found.append({"change": "flow", "loss": loss} | row | paired(free, crossing))
    return found


def paired(first: list[int], second: list[int]) -> dict[str, float]:
    """Mean of the differences over seeds and its 95 % interval by Student's t."""
    mean, low, high = paired_interval(first, second)
    return {"mean": mean, "low": low, "high": high, "n_seeds": len(first)}


WORK = {"given": given_row, "fits": fit_row, "carried": carried_row}


def tasks(config: dict) -> list[dict]:
    """All tasks, each with the name of its table."""
    given, fits, carried = config["given"], config["fits"], config["carried"]
    todo = [
        {"table": "given", "strength": strength, "level": level}
        for strength, level in itertools.product(given["strengths"], given["levels"])
    ]
    names = ("pair", "loss", "encoding", "spacing", "seed")
    for pair, spacings in fits["spacings"].items():
        arms = itertools.product([pair], fits["losses"], fits["encodings"], spacings, fits["seeds"])
        todo += [{"table": "fits"} | dict(zip(names, arm)) for arm in arms]
    arms = list(itertools.product(carried["arms"], fits["seeds"]))
    for table, spacing in (("carried", carried["spacing"]), ("fits", fits["finest"])):
        todo += [{"table": table} | dict(zip(names, (carried["pair"], *arm, spacing, seed))) for arm, seed in arms]
    return todo


def work(task: dict, config: dict) -> object:
    """The row of a task in its table."""
    return WORK[task["table"]](task, config)


def results(rows: list[dict], config: dict) -> dict:
    """The tables, and the differences between arms."""
    found: dict[str, list] = {name: [] for name in WORK}
    for row in rows:
        more = row["found"] if isinstance(row["found"], dict) else {"rows": row["found"]}
        found[row["task"]["table"]].append({k: v for k, v in row["task"].items() if k != "table"} | more)
    return rounded(found | {"differences": differences(found["fits"])})


if __name__ == "__main__":
    experiment.run(__file__, tasks, work, results, "synthetic folded spheres")
