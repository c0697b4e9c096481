"""Inputs of the benchmarks: weighted measures on folded surfaces, and the same surfaces as meshes."""

import numpy as np
import torch

from meshot import DiscreteMeasure, Mesh, SurfaceMeasure, random_directions, surface
from meshot.mesh import face_normals, folded_sphere, sample_locations

DEPTHS = (4.0, 8.0)  # depth of the folds of source and target, in mm
NORMAL_SCALE = 10.0  # length of a scaled unit normal, in mm
#: Possible numbers of faces of a folded sphere, by number of subdivisions.
FACES = {20 * 4**level: level for level in range(3, 8)}


def surface_measure(mesh: Mesh, n: int, d: int, seed: int) -> DiscreteMeasure:
    """Points of a surface, with scaled normals if d is 6, and random weights."""
    cells, barycentric = sample_locations(mesh, n, seed)
    points = (barycentric[:, :, None] * mesh.vertices[mesh.faces[cells]]).sum(dim=1)
    if d == 6:
        points = torch.cat([points, NORMAL_SCALE * face_normals(mesh)[cells]], dim=1)
    weights = torch.from_numpy(np.random.default_rng(seed).uniform(0.5, 1.5, n))
    return DiscreteMeasure(points, weights / weights.sum())


def measures(m: int, d: int, seed: int) -> tuple[DiscreteMeasure, DiscreteMeasure]:
    """Source and target with ``m`` support points each. Points and weights of the source require gradients."""
    source, target = (surface_measure(folded_sphere(6, depth=depth), m, d, seed + i) for i, depth in enumerate(DEPTHS))
    source.points.requires_grad_()
    source.weights.requires_grad_()
    return source, target


def surfaces(m: int, d: int) -> tuple[torch.Tensor, SurfaceMeasure, SurfaceMeasure]:
    """The vertices of the source, and both continuous measures, of meshes with ``m`` faces."""
    scale = NORMAL_SCALE if d == 6 else 0
    first, second = (folded_sphere(FACES[m], depth=depth) for depth in DEPTHS)
    vertices = first.vertices.clone().requires_grad_()
    return vertices, surface(first.with_vertices(vertices), normal_scale=scale), surface(second, normal_scale=scale)


def mesh_of(source: DiscreteMeasure) -> Mesh:
    """A closed mesh whose vertices are the points of a measure: a torus with m vertices and 2 m faces.

    The cost of the regularisers depends on the numbers of edges and faces, not on the positions of the vertices.
    """
    m = len(source.points)
    columns = next(k for k in range(int(m**0.5), 2, -1) if m % k == 0)
    corner = torch.arange(m).reshape(-1, columns)
    right, up = corner.roll(-1, 0), corner.roll(-1, 1)
    both = right.roll(-1, 1)
    faces = torch.cat([torch.stack([corner, right, both], -1), torch.stack([corner, both, up], -1)]).reshape(-1, 3)
    return Mesh(source.points[:, :3].detach(), faces)


def directions(n: int, d: int, seed: int) -> torch.Tensor:
    """The directions that all sliced losses use."""
    return random_directions(n, d, seed)
