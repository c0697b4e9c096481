"""Where the flows begin, and where they are to end."""

import numpy as np
import torch

from meshot.anatomy import Hemisphere, fsaverage5_surface
from meshot.flow.fitting import Leg, chain_end
from meshot.mesh import Mesh
from meshot.mesh.editing import decimated, laplacian_smoothing, smooth_crossings, with_edges_split
from meshot.mesh.geometry import edge_lengths, mesh_edges
from meshot.volume import Volume
from meshot.volume.surfaces import enclosed_fractions, isosurface

MOST_CUTS = 8  # rounds; an edge is then a 256th of what it was


def target_surface(side: Hemisphere) -> Mesh:
    """fsaverage5's white surface; its right hemisphere has four crossing faces, which are mended."""
    return smooth_crossings(fsaverage5_surface("white", side))


def start_surface(side: Hemisphere, start: dict) -> Mesh:
    """The target smoothed; with a voxel size in ``start``, remeshed too, so that not even the connectivity is left."""
    smooth = laplacian_smoothing(target_surface(side), start["smoothing"])
    return remeshed(smooth, start["voxel"], start["n_faces"], start["evening"]) if "voxel" in start else smooth


def remeshed(mesh: Mesh, voxel: float, n_faces: int, evening: int) -> Mesh:
    """Another triangulation of nearly the same surface: its voxels, marching cubes, fewer faces, a little smoothing."""
    lower, upper = (bound.numpy() for bound in (mesh.vertices.amin(dim=0), mesh.vertices.amax(dim=0)))
    affine = np.diag([voxel, voxel, voxel, 1.0])
    affine[:3, 3] = lower - 3 * voxel
    shape = np.ceil((upper - lower) / voxel).astype(int) + 7
    grid = Volume(np.zeros(shape, dtype=np.float32), affine)
    surface = isosurface(grid.with_data(enclosed_fractions(mesh, grid).astype(np.float32)))
    return smooth_crossings(laplacian_smoothing(decimated(surface, n_faces).to(torch.float64), evening))


@torch.no_grad()
def carried(legs: list[Leg], mesh: Mesh) -> Mesh:
    """The mesh where the chain takes it."""
    return mesh.with_vertices(chain_end(legs, mesh.vertices))


def cut_where_stretched(start: Mesh, legs: list[Leg], longest: float) -> Mesh:
    """The same start with edges cut in two until none is longer than ``longest`` where the chain has taken it.

    A flow carries points; between them a triangle stays flat, and where it is stretched far it leaves the path of the
    surface and meets others.
    """
    for _ in range(MOST_CUTS):
        end = carried(legs, start)
        long = mesh_edges(end)[edge_lengths(end) > longest]
        if not len(long):
            break
        start = with_edges_split(start, long)
    return start
