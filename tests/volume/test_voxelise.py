"""Voxels inside a mesh, and their distance from it, against spheres."""

import numpy as np
import pytest
import torch

from affines import FLIPPED, OBLIQUE
from meshot.mesh.geometry import signed_volume
from meshot.mesh.mesh import Mesh
from meshot.mesh.shapes import cube, icosphere
from meshot.volume.surfaces import enclosed_fractions, enclosed_voxels, voxel_distance, winding_numbers
from meshot.volume.volume import Volume

CENTRE = (13.0, 14.0, 15.0)


def radii(grid: Volume) -> np.ndarray:
    places = np.stack(np.meshgrid(*map(np.arange, grid.data.shape), indexing="ij"), axis=-1)
    return np.linalg.norm(places @ grid.affine[:3, :3].T + grid.affine[:3, 3] - CENTRE, axis=-1)


@pytest.mark.parametrize("affine", [np.eye(4), OBLIQUE, FLIPPED], ids=["plain", "oblique", "flipped"])
def test_voxels_inside_a_sphere(affine):
    grid = Volume(np.zeros((30, 31, 33)), affine)
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


@pytest.mark.parametrize("affine", [np.eye(4), OBLIQUE, FLIPPED], ids=["plain", "oblique", "flipped"])
def test_fractions_of_a_sphere(affine):
    grid = Volume(np.zeros((30, 31, 32)), affine)
    sphere = icosphere(5, 9.0, CENTRE)
    fractions, radius = enclosed_fractions(sphere, grid, n_lines=5), radii(grid)
    volume = fractions.sum() * abs(np.linalg.det(affine[:3, :3]))
    assert volume == pytest.approx(float(signed_volume(sphere)), rel=2e-3)
    half_diagonal = np.linalg.norm(affine[:3, :3], axis=0).sum() / 2 + 0.05
    np.testing.assert_allclose(fractions[radius < 9 - half_diagonal], 1, atol=1e-9)
    np.testing.assert_allclose(fractions[radius > 9 + half_diagonal], 0, atol=1e-9)


def test_fractions_of_a_box_that_cuts_voxels():
    box = cube()
    low, high = box.vertices.min(dim=0).values, box.vertices.max(dim=0).values
    corners = torch.tensor([[1.0, 2.0, 3.2], [4.0, 5.0, 5.75]], dtype=torch.float64)
    box = box.with_vertices(corners[0] + (box.vertices - low) / (high - low) * (corners[1] - corners[0]))
    fractions = enclosed_fractions(box, Volume(np.zeros((7, 8, 9)), np.eye(4)), n_lines=4)
    along = [
        np.array([0, 0.5, 1, 1, 0.5, 0, 0]),
        np.array([0, 0, 0.5, 1, 1, 0.5, 0, 0]),
        np.array([0, 0, 0, 0.3, 1, 1, 0.25, 0, 0]),
    ]
    np.testing.assert_allclose(fractions, np.einsum("i,j,k->ijk", *along), atol=1e-6)


def test_fractions_refuse_what_has_no_inside():
    sphere, grid = icosphere(2, 9.0, CENTRE), Volume(np.zeros((30, 30, 30)), np.eye(4))
    with pytest.raises(ValueError, match="not closed"):
        enclosed_fractions(Mesh(sphere.vertices, sphere.faces[1:]), grid)
    with pytest.raises(ValueError, match="point inward"):
        enclosed_fractions(Mesh(sphere.vertices, sphere.faces.flip(1)), grid)
    with pytest.raises(ValueError, match="n_lines is 0"):
        enclosed_fractions(sphere, grid, n_lines=0)


def test_winding_numbers_count_nested_and_inverted_spheres():
    grid = Volume(np.zeros((30, 30, 30)), np.eye(4))
    spheres = [(9.0, CENTRE, False), (4.0, CENTRE, False), (3.0, (13.0, 14.0, 26.5), True)]
    meshes = [icosphere(3, radius, centre) for radius, centre, _ in spheres]
    n = len(meshes[0].vertices)
    faces = [m.faces.flip(1) + k * n if s[2] else m.faces + k * n for k, (m, s) in enumerate(zip(meshes, spheres))]
    numbers = winding_numbers(Mesh(torch.cat([m.vertices for m in meshes]), torch.cat(faces)), grid)
    assert [round(float(numbers[13, 14, z]), 6) for z in (1, 8, 15, 26)] == [0, 1, 2, -1]
    assert numbers.sum() == pytest.approx(
        sum(float(signed_volume(m)) * (1, 1, -1)[k] for k, m in enumerate(meshes)), rel=0.01
    )
