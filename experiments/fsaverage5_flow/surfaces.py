"""The initial and the target surfaces."""

import numpy as np
import torch

from meshot.anatomy import Hemisphere, fsaverage5_surface
from meshot.mesh import (
    Mesh,
    decimated,
    edge_lengths,
    laplacian_smoothing,
    mesh_edges,
    smooth_crossings,
    with_edges_split,
)
from meshot.volume import Volume, enclosed_fractions, isosurface
from meshot_book.flows import Leg, chain_end

MOST_CUTS = 8  # maximum number of divisions; an edge is then 1/256 of its length


def target_surface(side: Hemisphere) -> Mesh:
    """fsaverage5's white surface. Its right hemisphere has four self-intersecting faces, which are repaired."""
    return smooth_crossings(fsaverage5_surface("white", side))


def start_surface(side: Hemisphere, start: dict) -> Mesh:
    """The smoothed target; with a voxel size in ``start`` also remeshed, so that the connectivity differs."""
    smooth = laplacian_smoothing(target_surface(side), start["smoothing"])
    return remeshed(smooth, start["voxel"], start["n_faces"], start["evening"]) if "voxel" in start else smooth


def remeshed(mesh: Mesh, voxel: float, n_faces: int, evening: int) -> Mesh:
    """Another triangulation of nearly the same surface: voxelisation, marching cubes, decimation, light smoothing."""
    lower, upper = (bound.numpy() for bound in (mesh.vertices.amin(dim=0), mesh.vertices.amax(dim=0)))
    affine = np.diag([voxel, voxel, voxel, 1.0])
    affine[:3, 3] = lower - 3 * voxel
    shape = np.ceil((upper - lower) / voxel).astype(int) + 7
    grid = Volume(np.zeros(shape, dtype=np.float32), affine)
    surface = isosurface(grid.with_data(enclosed_fractions(mesh, grid).astype(np.float32)))
    return smooth_crossings(laplacian_smoothing(decimated(surface, n_faces).to(torch.float64), evening))


@torch.no_grad()
def carried(legs: list[Leg], mesh: Mesh) -> Mesh:
    """The mesh after the sequence of flows."""
    return mesh.with_vertices(chain_end(legs, mesh.vertices))


def cut_where_stretched(start: Mesh, legs: list[Leg], longest: float) -> Mesh:
    """The start with edges divided until none is longer than ``longest`` after the sequence of flows.

    A flow moves points. Triangles between them stay flat. Where a triangle is stretched, it deviates from the moved
    surface and may intersect other triangles.
    """
    for _ in range(MOST_CUTS):
        end = carried(legs, start)
        long = mesh_edges(end)[edge_lengths(end) > longest]
        if not len(long):
            break
        start = with_edges_split(start, long)
    return start
