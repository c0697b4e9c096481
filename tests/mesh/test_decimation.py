"""Fewer faces: on spheres, where the distance from the surface is known."""

import pytest
import torch

from meshot.mesh.connectivity import SPHERE, topology
from meshot.mesh.editing import decimated, simplified
from meshot.mesh.shapes import icosphere
from meshot.metrics.distances import vertex_distances


@pytest.mark.parametrize("fewer", [decimated, simplified])
def test_a_sphere_stays_a_sphere(fewer):
    sphere = icosphere(4, 10.0)
    found = fewer(sphere, 640)
    assert len(found.faces) == 640
    assert topology(found) == SPHERE
    assert float((found.vertices.norm(dim=1) - 10).abs().max()) < 0.3
    assert fewer(sphere, 10_000) is sphere
    assert fewer(sphere.to(torch.float32), 640).vertices.dtype == torch.float32
    with pytest.raises(ValueError, match="n_faces is 0"):
        fewer(sphere, 0)


def test_quadric_errors_stay_near_a_curved_surface():
    # An ellipsoid: flat in the middle, sharp at its rim, where short edges alone would round it off.
    fine = icosphere(5, 1.0)
    fine = fine.with_vertices(fine.vertices * torch.tensor([20.0, 20.0, 5.0], dtype=torch.float64))
    gaps = [float(vertex_distances(fine, fewer(fine, 640)).mean()) for fewer in (simplified, decimated)]
    assert gaps[0] < 0.5 * gaps[1]
    assert gaps[0] < 0.1
