"""One descent of a mesh under the sliced loss, and a comparison of gradients at its start."""

from collections.abc import Callable

import numpy as np
import torch
from scipy.spatial.transform import Rotation

import meshot.mesh
from meshot import (
    DiscreteMeasure,
    Mesh,
    SurfaceMeasure,
    quasi_directions,
    random_directions,
    sliced_wasserstein,
    surface,
    varifold,
)
from meshot.mesh import edge_lengths, face_area_vectors, icosphere, split_in_four
from meshot.metrics import Surface, average_surface_distance
from meshot.types import Tensor
from meshot_book.flows import descend
from meshot_book.statistics import short


def target_mesh(settings: dict) -> Mesh:
    """The mesh described by an entry of ``targets``."""
    settings = dict(settings)
    n_splits = settings.pop("splits", 0)
    mesh = getattr(meshot.mesh, settings.pop("shape"))(**settings)
    vertices, faces = mesh.vertices, mesh.faces
    for _ in range(n_splits):
        vertices, faces = split_in_four(vertices, faces)
    return Mesh(vertices, faces)


def start_mesh(settings: dict, generator: np.random.Generator) -> Mesh:
    """A triangulated sphere with random rotation and jitter."""
    sphere = icosphere(settings["subdivisions"])
    turn = torch.from_numpy(Rotation.random(rng=generator).as_matrix().copy())
    jitter = torch.from_numpy(generator.standard_normal(sphere.vertices.shape))
    return sphere.with_vertices(sphere.vertices @ turn.T + settings["jitter"] * jitter)


def doubled(mesh: Mesh) -> Mesh:
    """Every face twice: twice the area, the same normalised measure."""
    return Mesh(mesh.vertices.repeat(2, 1), torch.cat([mesh.faces, mesh.faces + len(mesh.vertices)]))


def pleated_square(n_pleats: int, slope: float) -> Mesh:
    """The unit square with pleats along x of the given slope. Its area is √(1 + slope²)."""
    n = 2 * n_pleats
    x = torch.linspace(0, 1, n + 1, dtype=torch.float64)
    height = slope / n * (torch.arange(n + 1) % 2).double()
    rows = [torch.stack([x, torch.full_like(x, y), height], dim=1) for y in (0.0, 1.0)]
    left = torch.arange(n)
    faces = torch.cat([_columns(left, left + 1, left + n + 2), _columns(left, left + n + 2, left + n + 1)])
    return Mesh(torch.cat(rows), faces)


def _columns(*corners: Tensor) -> Tensor:
    return torch.stack(corners, dim=1)


DIMENSIONS = {"surface": 3, "varifold": 6}


def encoded(mesh: Mesh, encoding: str, config: dict, detach: bool = False) -> DiscreteMeasure | SurfaceMeasure:
    """The encoding of a mesh in a run."""
    if encoding == "surface":
        return surface(mesh, detach_weights=detach)
    return varifold(mesh, normal_scale=config["normal_scale"], detach_weights=detach)


def run_once(run: dict, seed: int, config: dict) -> dict:
    """Do one descent and evaluate the final mesh. A learning rate at which the mesh collapses is also a result."""
    goal = target_mesh(config["targets"][run["target"]])
    # Variants of one seed have the same start and directions, so that differences are paired.
    start = start_mesh(config["source"], np.random.default_rng([seed, 0]))
    loss = _mesh_loss(run, start, goal, config, np.random.default_rng([seed, 1]))
    try:
        end = descend(loss, start.vertices, config["n_steps"], run["learning_rate"], config["momentum"]).points
    except ValueError:
        return {"collapsed": True}
    return {"collapsed": False} | judged(start.with_vertices(end), goal, config)


def _mesh_loss(run: dict, start: Mesh, goal: Mesh, config: dict, generator: np.random.Generator) -> Callable:
    encoding, detach = run["encoding"], run["detach_weights"]
    target = encoded(goal, encoding, config)

    def loss(vertices: Tensor) -> Tensor:
        directions = random_directions(config["n_directions"], DIMENSIONS[encoding], generator)
        source = encoded(start.with_vertices(vertices), encoding, config, detach)
        # Multiplied by the number of vertices, so that the gradient of a vertex does not depend on this number.
        return len(vertices) * sliced_wasserstein(source, target, directions)

    return loss


def judged(end: Mesh, goal: Mesh, config: dict) -> dict:
    """Distances from the mesh to its target, also by metrics that its descent did not minimise, and edge variation."""
    values = {}
    for encoding, d in DIMENSIONS.items():
        directions = quasi_directions(config["n_judging_directions"], d)
        cost = sliced_wasserstein(encoded(end, encoding, config), encoded(goal, encoding, config), directions)
        values[f"sw_{encoding}"] = float(cost) ** 0.5
    one, other = Surface(end), Surface(goal)
    samples = [s.sample(config["n_judging_points"], np.random.default_rng(0)) for s in (one, other)]
    values["assd"] = average_surface_distance(other.offsets(samples[0]), one.offsets(samples[1]))
    edges = edge_lengths(end)
    values["edge_variation"] = float(edges.std() / edges.mean())
    return {name: short(value) for name, value in values.items()}


def gradients_at_start(target: str, encoding: str, seed: int, config: dict) -> dict:
    """The gradient with and without areas: the angle between both, their tangential parts, finite differences."""
    generator = np.random.default_rng([seed, 0])
    start = start_mesh(config["source"], generator)
    goal = encoded(target_mesh(config["targets"][target]), encoding, config)
    directions = quasi_directions(config["n_judging_directions"], DIMENSIONS[encoding])

    def loss(vertices: Tensor, detach: bool) -> Tensor:
        return sliced_wasserstein(encoded(start.with_vertices(vertices), encoding, config, detach), goal, directions)

    moving = start.vertices.clone().requires_grad_()
    full, stopped = (torch.autograd.grad(loss(moving, detach), moving)[0] for detach in (False, True))
    step = 1e-6 * torch.from_numpy(generator.standard_normal(start.vertices.shape))
    with torch.no_grad():
        slope = float(loss(start.vertices + step, False) - loss(start.vertices - step, False)) / 2
    cosine = torch.nn.functional.cosine_similarity(full.flatten(), stopped.flatten(), dim=0)
    found = {"cosine": float(cosine), "length_ratio": float(stopped.norm() / full.norm())}
    for name, gradient in (("full", full), ("stopped", stopped)):
        found[f"tangential_{name}"] = tangential_share(start, gradient)
        found[f"slope_error_{name}"] = abs(float((gradient * step).sum()) - slope) / abs(slope)
    return found


def tangential_share(mesh: Mesh, gradient: Tensor) -> float:
    """The tangential share of the squared length of the gradient, with area-weighted vertex normals."""
    normals = torch.zeros_like(mesh.vertices)
    normals = normals.index_add(0, mesh.faces.flatten(), face_area_vectors(mesh).repeat_interleave(3, dim=0))
    normals = torch.nn.functional.normalize(normals, dim=1)
    across = (gradient * normals).sum(dim=1).square().sum()
    return float(1 - across / gradient.square().sum())
