"""Voxels inside a mesh, and their distance from it, against spheres."""

import numpy as np
import pytest

from affines import FLIPPED, OBLIQUE
from meshot.mesh.mesh import Mesh
from meshot.mesh.shapes import icosphere
from meshot.volume.volume import Volume
from meshot.volume.voxelise import enclosed_voxels, voxel_distance

CENTRE = (13.0, 14.0, 15.0)


def radii(grid: Volume) -> np.ndarray:
    places = np.stack(np.meshgrid(*map(np.arange, grid.data.shape), indexing="ij"), axis=-1)
    return np.linalg.norm(places @ grid.affine[:3, :3].T + grid.affine[:3, 3] - CENTRE, axis=-1)


@pytest.mark.parametrize("affine", [np.eye(4), OBLIQUE, FLIPPED], ids=["plain", "oblique", "flipped"])
def test_voxels_inside_a_sphere(affine):
    grid = Volume(np.zeros((30, 31, 32)), affine)
    inside, radius = enclosed_voxels(icosphere(5, 9.0, CENTRE), grid), radii(grid)
    clear = np.abs(radius - 9) > 0.02
    assert inside.any()
    assert (inside == (radius < 9))[clear].all()


def test_a_mesh_that_leaves_the_grid():
    grid = Volume(np.zeros((10, 31, 12)), np.eye(4))
    radius = radii(grid)
    inside = enclosed_voxels(icosphere(5, 9.0, CENTRE), grid)
    assert (inside == (radius < 9))[np.abs(radius - 9) > 0.02].all()


def test_distance_within_a_voxel():
    grid = Volume(np.zeros((30, 31, 32)), np.eye(4))
    distance = voxel_distance(icosphere(4, 9.0, CENTRE), grid)
    assert np.abs(distance - (radii(grid) - 9)).max() < 1


def test_an_open_mesh_is_refused():
    sphere = icosphere(2, 9.0, CENTRE)
    with pytest.raises(ValueError, match="not closed"):
        enclosed_voxels(Mesh(sphere.vertices, sphere.faces[1:]), Volume(np.zeros((30, 31, 32)), np.eye(4)))
