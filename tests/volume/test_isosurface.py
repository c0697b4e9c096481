"""Surfaces of spheres and masks, in the right place, with the right side out."""

import math

import numpy as np
import pytest
import torch

from affines import FLIPPED, OBLIQUE
from meshot.mesh.connectivity import SPHERE, topology
from meshot.mesh.geometry import face_areas, signed_volume
from meshot.volume.surfaces import isosurface, separated_field
from meshot.volume.volume import Volume, sample_volume

RADIUS = 9.0


def ball(affine: np.ndarray) -> Volume:
    """Signed distance, positive inside, of a sphere in mm around the middle of a grid."""
    grid = np.stack(np.meshgrid(*(np.arange(32),) * 3, indexing="ij"), axis=-1)
    places = (grid - 15.5) @ affine[:3, :3].T
    return Volume(RADIUS - np.linalg.norm(places, axis=-1), affine)


@pytest.mark.parametrize("affine", [np.eye(4), OBLIQUE, FLIPPED], ids=["plain", "oblique", "flipped"])
def test_a_sphere_in_mm_with_outward_normals(affine):
    mesh = isosurface(ball(affine), 0.0)
    centre = torch.from_numpy(affine[:3, :3] @ np.full(3, 15.5) + affine[:3, 3])
    assert topology(mesh) == SPHERE
    assert float((mesh.vertices - centre).norm(dim=1).sub(RADIUS).abs().max()) < 0.1
    # Faces are chords: area and volume from below.
    assert 0.97 < float(signed_volume(mesh)) / (4 / 3 * math.pi * RADIUS**3) < 1
    assert 0.98 < float(face_areas(mesh).sum()) / (4 * math.pi * RADIUS**2) < 1
    assert float(sample_volume(ball(affine), mesh.vertices).abs().max()) < 1e-5


def test_an_object_at_the_rim_is_closed():
    mesh = isosurface(Volume(np.pad(np.ones((3, 3, 3)), ((0, 1), (0, 1), (0, 1))), np.eye(4)))
    assert topology(mesh) == SPHERE
    assert float(mesh.vertices.min()) == -0.5


@pytest.mark.parametrize("value", [0.0, 1.0])
def test_a_constant_volume_has_no_surface(value):
    with pytest.raises(ValueError, match="strictly between"):
        isosurface(Volume(np.full((3, 3, 3), value), np.eye(4)))


def test_a_separated_field_has_the_sides_of_its_mask_and_keeps_the_rest():
    field = Volume(np.array([0.9, 0.52, 0.2, 0.7, 0.1]).reshape(1, 1, 5), np.eye(4))
    mask = np.array([True, True, True, False, False]).reshape(1, 1, 5)
    assert separated_field(field, mask).data.ravel() == pytest.approx([0.9, 0.55, 0.8, 0.3, 0.1])
    with pytest.raises(ValueError, match="one value for each voxel"):
        separated_field(field, mask[:, :, :3])
