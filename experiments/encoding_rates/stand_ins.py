"""Discrete encodings of a mesh: its varifold, two other quadrature rules on the same faces, and random samples."""

import numpy as np
import torch

from meshot import DiscreteMeasure, Mesh, SurfaceMeasure, surface, varifold
from meshot.mesh import face_areas, face_normals, sample_locations


def continuous(mesh: Mesh, normal_scale: float) -> SurfaceMeasure:
    """The reference: the continuous surface, with its scaled face normals unless the scale is zero."""
    return surface(mesh, normal_scale=normal_scale)


def atoms(mesh: Mesh, rule: str, normal_scale: float) -> DiscreteMeasure:
    """A quadrature rule on every face: one atom at its barycentre, or a third of its area at each midpoint or corner.

    The barycentre rule with normals is the oriented varifold. The other two rules have positions only.
    """
    if rule == "barycentres":
        encoded = varifold(mesh, normal_scale=normal_scale)
        points = encoded.points if normal_scale > 0 else encoded.points[:, :3].contiguous()
        return DiscreteMeasure(points, encoded.weights)
    corners = mesh.vertices[mesh.faces]
    places = corners if rule == "vertices" else (corners + corners.roll(1, dims=1)) / 2
    points, which = torch.unique(places.reshape(-1, 3), dim=0, return_inverse=True)
    areas = face_areas(mesh)
    shares = (areas / areas.sum() / 3).repeat_interleave(3)
    return DiscreteMeasure(points, torch.zeros(len(points), dtype=shares.dtype).index_add(0, which, shares))


def sample(mesh: Mesh, n_points: int, normal_scale: float, generator: np.random.Generator) -> DiscreteMeasure:
    """Independent points, uniform by area, each with the scaled normal of its face unless the scale is zero."""
    faces, barycentric = sample_locations(mesh, n_points, generator)
    points = (barycentric[:, :, None] * mesh.vertices[mesh.faces[faces]]).sum(dim=1)
    if normal_scale > 0:
        points = torch.cat([points, normal_scale * face_normals(mesh)[faces]], dim=1)
    return DiscreteMeasure(points)
