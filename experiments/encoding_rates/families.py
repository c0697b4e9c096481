"""Families of meshes that are refined together: a polyhedron, smooth shapes, a cortical surface, an uneven mesh."""

import functools
import math

import torch

from meshot.anatomy import fsaverage5_surface
from meshot.mesh import Mesh, cube, decimated, ellipsoid, folded_sphere, icosphere, split_in_four


def pair_of_meshes(family: str, level: int, config: dict) -> tuple[Mesh, Mesh]:
    """The mesh of a family at a level, and the mesh that it is compared with, refined in the same way."""
    if family in ("cube", "uneven_cube"):
        refine = refined if family == "cube" else refined_on_one_side
        return refine(cube(), level), refine(turned_box(), level)
    if family == "sphere":
        return icosphere(level), ellipsoid(level, (1.1, 0.9, 0.8))
    if family == "folded_sphere":
        return folded_sphere(level, 1.0, 0.15, 5), icosphere(level)
    white, pial = (_cortex(kind, config["cortex"]["hemisphere"]) for kind in ("white", "pial"))
    if family == "cortex_decimated":
        return decimated(white, level), decimated(pial, level)
    n_faces = config["cortex"]["coarsest"]
    return refined(decimated(white, n_faces), level), refined(decimated(pial, n_faces), level)


@functools.cache
def _cortex(kind: str, hemisphere: str) -> Mesh:
    return fsaverage5_surface(kind, hemisphere)


def turned_box() -> Mesh:
    """A box with unequal sides, rotated and translated, so that no face is parallel to a face of the cube."""
    box = cube()
    a, b = 0.4, 0.7
    about_z = torch.tensor([[math.cos(a), -math.sin(a), 0], [math.sin(a), math.cos(a), 0], [0, 0, 1]])
    about_x = torch.tensor([[1, 0, 0], [0, math.cos(b), -math.sin(b)], [0, math.sin(b), math.cos(b)]])
    sides, shift = torch.tensor([1.2, 0.9, 0.8]), torch.tensor([0.2, 0.1, -0.1])
    turn = (about_x @ about_z).to(torch.float64)
    return box.with_vertices((box.vertices * sides.to(torch.float64)) @ turn.T + shift.to(torch.float64))


def refined(mesh: Mesh, times: int) -> Mesh:
    """Every face divided into four, ``times`` times: the same surface."""
    vertices, faces = mesh.vertices, mesh.faces
    for _ in range(times):
        vertices, faces = split_in_four(vertices, faces)
    return Mesh(vertices, faces)


def refined_on_one_side(mesh: Mesh, times: int) -> Mesh:
    """One side of a cube with faces divided into four, ``times`` times; the other five sides do not change."""
    # Faces 0 and 6 of a cube are the two halves of one side.
    vertices = mesh.vertices
    fine, coarse = mesh.faces[[0, 6]], mesh.faces[[1, 2, 3, 4, 5, 7, 8, 9, 10, 11]]
    for _ in range(times):
        vertices, fine = split_in_four(vertices, fine)
    return Mesh(vertices, torch.cat([fine, coarse]))


def displaced(mesh: Mesh, amplitude: float, wavelength: float) -> Mesh:
    """The mesh after a small smooth displacement along x, y and z, with a wave in each."""
    wave = torch.sin(2 * math.pi / wavelength * mesh.vertices.roll(1, dims=1))
    return mesh.with_vertices(mesh.vertices + amplitude * wave)
