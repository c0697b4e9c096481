"""Distances and normal angles between points of one surface and the faces of another."""

import dataclasses

import igl
import numpy as np
import torch

from meshot.errors import require_finite, require_positive_integer
from meshot.mesh import Mesh, sample_locations
from meshot.mesh.geometry import face_normals
from meshot.rng import Generator
from meshot.types import Array, Float


@dataclasses.dataclass(frozen=True, eq=False)
class SurfaceSample:
    """Random points on a surface, uniform by area, with the unit normals of their faces."""

    points: Float[Array, "n 3"]
    normals: Float[Array, "n 3"]


@dataclasses.dataclass(frozen=True, eq=False)
class Offsets:
    """Distances from points of one surface to the faces of another, and cosines between the normals there."""

    distances: Float[Array, " n"]
    cosines: Float[Array, " n"]


class Surface:
    """A mesh in double precision with a search tree of its faces, for nearest-point queries.

    Raises
    ------
    ValueError
        If a vertex is NaN or infinite (``with_vertices`` does not check this).
    """

    def __init__(self, mesh: Mesh):
        require_finite(mesh.vertices, "vertices")
        self.mesh = mesh.with_vertices(mesh.vertices.detach()).to("cpu", torch.float64)
        self.vertices = np.ascontiguousarray(self.mesh.vertices.numpy())
        self.faces = np.ascontiguousarray(self.mesh.faces.numpy())
        self.normals = face_normals(self.mesh).numpy()
        self.tree = igl.AABB()
        self.tree.init(self.vertices, self.faces)

    def sample(self, n_points: int, generator: Generator) -> SurfaceSample:
        """Independent random points, uniform by area."""
        require_positive_integer(n_points, "n_points")
        faces, barycentric = (x.numpy() for x in sample_locations(self.mesh, n_points, generator))
        corners = self.vertices[self.faces[faces]]
        return SurfaceSample(np.einsum("nc,nck->nk", barycentric, corners), self.normals[faces])

    def offsets(self, sample: SurfaceSample) -> Offsets:
        """Distances from the points of another surface to this surface, and cosines between the normals there."""
        squared, faces, _ = self.tree.squared_distance(self.vertices, self.faces, sample.points)
        # For a point on the surface itself, rounding can give a slightly negative square.
        return Offsets(np.sqrt(np.maximum(squared, 0)), (self.normals[faces] * sample.normals).sum(axis=1))


def offsets_between(
    first: Surface, second: Surface, n_points: int, generators: tuple[Generator, Generator] = (0, 1)
) -> tuple[Offsets, Offsets]:
    """Distances and normal cosines from ``n_points`` random points of each surface to the other surface."""
    there, back = (each.sample(n_points, draw) for each, draw in zip((first, second), generators, strict=True))
    return second.offsets(there), first.offsets(back)


def average_surface_distance(there: Offsets, back: Offsets) -> float:
    """ASSD, the average symmetric surface distance: the mean of the two mean distances."""
    return float(there.distances.mean() + back.distances.mean()) / 2


def hausdorff_distance(there: Offsets, back: Offsets, quantile: float = 0.9) -> float:
    """The larger of the two quantiles of the distances. With ``quantile`` 1, the Hausdorff distance of the samples.

    Raises
    ------
    ValueError
        If the quantile is not in (0, 1].
    """
    if not 0 < quantile <= 1:
        raise ValueError(f"quantile is {quantile!r}; a number in (0, 1] is needed, such as 0.9")
    return float(max(np.quantile(there.distances, quantile), np.quantile(back.distances, quantile)))


def normal_agreement(there: Offsets, back: Offsets, signed: bool = False) -> float:
    """Chamfer normals: the mean of the two mean cosines between normals, in absolute value unless ``signed``."""
    cosines = [x.cosines if signed else np.abs(x.cosines) for x in (there, back)]
    return float(cosines[0].mean() + cosines[1].mean()) / 2


def vertex_distances(mesh: Mesh, target: Mesh) -> Float[Array, " V"]:
    """The distance of every vertex to the nearest point on the faces of another surface, in units of the vertices."""
    points = mesh.vertices.detach().double().cpu().numpy()
    return Surface(target).offsets(SurfaceSample(points, np.zeros_like(points))).distances
