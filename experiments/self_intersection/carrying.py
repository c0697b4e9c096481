"""Meshes of several resolutions moved by a given or fitted field, with several integration methods and step numbers."""

import torch
from fitting import fitted_flow, turned_sphere

from meshot import Mesh
from meshot.flow import Velocity, inspect_paths, integrate, trajectory
from meshot.mesh import icosphere, self_intersecting_faces
from meshot_book.flows import Vortex


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
