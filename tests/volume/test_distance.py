"""Signed distance against spheres, a second library and a mask; the errors that the docstring states."""

import igl
import numpy as np
import pytest
import torch

from affines import FLIPPED
from meshot.mesh.shapes import icosphere
from meshot.volume.surfaces import enclosed_fractions, isosurface, signed_distance
from meshot.volume.volume import Volume, sample_volume, voxel_to_mm

TURNED = np.array([[0.8, -0.9, 0, -60], [0.6, 1.2, 0, 20], [0, 0, 2.0, -50], [0, 0, 0, 1]])  # rows of 1, 1.5, 2 mm
STANDARD_SIZES = np.array([1.5, 208 / 144, 1.5])


def sphere_on_the_standard_grid(radius: float, kind: str) -> tuple[Volume, np.ndarray]:
    """A sphere beside the middle of a grid, and the true signed distance of every voxel."""
    shape = np.ceil((2 * radius + 16) / STANDARD_SIZES).astype(int)
    centre = (shape - 1) / 2 * STANDARD_SIZES + [0.31, 0.17, -0.2]
    grid = Volume(np.zeros(shape), np.diag([*STANDARD_SIZES, 1.0]))
    places = np.moveaxis(np.indices(shape), 0, -1) * STANDARD_SIZES
    truth = np.linalg.norm(places - centre, axis=-1) - radius
    if kind == "mask":
        return grid.with_data((truth < 0).astype(float)), truth
    return grid.with_data(enclosed_fractions(icosphere(5, radius, tuple(centre)), grid)), truth


@pytest.mark.parametrize("radius", [6.0, 15.0, 30.0])
@pytest.mark.parametrize(("kind", "largest", "mean"), [("fractions", 0.6, 0.12), ("mask", 0.8, 0.31)])
def test_the_error_on_spheres_is_as_stated(radius, kind, largest, mean):
    field, truth = sphere_on_the_standard_grid(radius, kind)
    error = np.abs(signed_distance(field).data - truth)
    assert error.max() < largest
    assert error.mean() < mean


def test_sub_voxel_truth_gets_better_with_flatter_surfaces():
    means = [
        np.abs(signed_distance(f).data - t).mean()
        for f, t in (sphere_on_the_standard_grid(r, "fractions") for r in (6.0, 24.0))
    ]
    assert means[1] < 0.6 * means[0]
    assert means[1] < 0.06


def test_distance_to_the_triangles_is_exact_near_them_and_nearly_so_beyond():
    field, _ = sphere_on_the_standard_grid(14.0, "fractions")
    mesh = isosurface(field)
    centres = voxel_to_mm(field, torch.from_numpy(np.indices(field.data.shape).reshape(3, -1).T.astype(float)))
    squared = igl.point_mesh_squared_distance(centres.numpy(), mesh.vertices.numpy(), mesh.faces.numpy())[0]
    truth = np.sqrt(squared).reshape(field.data.shape)
    error = np.abs(signed_distance(field).data) - truth
    near = truth < 2.25
    assert np.abs(error[near]).max() < 1e-9
    assert error.min() > -1e-9
    assert error.max() < 0.3
    assert error.mean() < 0.05
    assert near.mean() < 0.5


@pytest.mark.parametrize("affine", [TURNED, FLIPPED], ids=["turned", "flipped"])
def test_distance_is_in_millimetres_and_negative_inside_in_any_space(affine):
    grid = Volume(np.zeros((24, 26, 22)), affine)
    centre = voxel_to_mm(grid, torch.tensor([[11.5, 12.5, 10.5]], dtype=torch.float64))
    sphere = icosphere(4, 6.0, tuple(centre[0].tolist()))
    distance = signed_distance(grid.with_data(enclosed_fractions(sphere, grid)))
    for radius in (3.0, 6.0, 9.0):
        points = icosphere(2, radius, tuple(centre[0].tolist())).vertices
        found = sample_volume(distance, points)
        assert float((found - (radius - 6)).abs().mean()) < 0.3


def test_bad_fields_are_refused():
    sheared = np.eye(4)
    sheared[0, 1] = 0.2
    field = np.pad(np.ones((2, 2, 2)), 2)
    with pytest.raises(ValueError, match="not orthogonal"):
        signed_distance(Volume(field, sheared))
    with pytest.raises(ValueError, match="must lie strictly between"):
        signed_distance(Volume(np.zeros((4, 4, 4)), np.eye(4)))
