"""The meshes of the experiment: the initial sphere, its targets, and surfaces that differ in area alone."""

import numpy as np
import torch
from scipy.spatial.transform import Rotation

import meshot.mesh
from meshot import Mesh
from meshot.mesh import icosphere, split_in_four
from meshot.types import Tensor


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
