import numpy as np
import pytest
import pyvista
import torch
import trimesh
from scipy.optimize import nnls

from meshot.mesh.mesh import Mesh
from meshot.mesh.shapes import cube, folded_sphere, icosphere
from meshot.metrics.distances import (
    Surface,
    average_surface_distance,
    hausdorff_distance,
    normal_agreement,
    vertex_distances,
)


def both_ways(one, other, n_points=4000, seeds=(0, 1)):
    one, other = Surface(one), Surface(other)
    return other.offsets(one.sample(n_points, seeds[0])), one.offsets(other.sample(n_points, seeds[1]))


def square(height, turned=False):
    vertices = torch.tensor([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]).double()
    faces = torch.tensor([[0, 1, 2], [0, 2, 3]])
    return Mesh(vertices + torch.tensor([0, 0, height]), faces.flip(1) if turned else faces)


def test_shifted_square():
    offsets = both_ways(square(0.0), square(0.25))
    assert average_surface_distance(*offsets) == pytest.approx(0.25)
    assert hausdorff_distance(*offsets) == pytest.approx(0.25)
    assert normal_agreement(*offsets, signed=True) == pytest.approx(1)


def test_square_turned_over():
    offsets = both_ways(square(0.0), square(0.25, turned=True))
    assert normal_agreement(*offsets) == pytest.approx(1)
    assert normal_agreement(*offsets, signed=True) == pytest.approx(-1)


def test_concentric_spheres():
    offsets = both_ways(icosphere(5, 10.0), icosphere(5, 12.0))
    assert average_surface_distance(*offsets) == pytest.approx(2, rel=2e-3)
    assert hausdorff_distance(*offsets) == pytest.approx(2, rel=5e-3)
    assert normal_agreement(*offsets, signed=True) == pytest.approx(1, abs=2e-3)


def test_one_sided_excess_counts_once():
    # A big square against the unit square within it: only one side sees the margin.
    small = square(0.0)
    big = small.with_vertices(3 * small.vertices - torch.tensor([1.0, 1.0, 0.0]).double())
    there, back = both_ways(big, small, 200_000)
    assert back.distances.max() < 1e-12
    # E max over the L-shaped margin: 4 strips at mean ½ and 4 corners at mean (√2 + asinh 1)/3, of 9 unit cells.
    expected = (4 * 0.5 + 4 * (np.sqrt(2) + np.arcsinh(1)) / 3) / 9
    assert average_surface_distance(there, back) == pytest.approx(expected / 2, rel=5e-3)
    assert hausdorff_distance(there, back) == pytest.approx(np.quantile(there.distances, 0.9))
    assert hausdorff_distance(there, back) == hausdorff_distance(back, there) > 0.9


def test_offsets_against_vtk():
    one, other = folded_sphere(2), icosphere(2, 40.0)
    sample = Surface(one).sample(300, 3)
    offsets = Surface(other).offsets(sample)
    peer = pyvista.PolyData.from_regular_faces(other.vertices.numpy(), other.faces.numpy())
    faces, nearest = peer.find_closest_cell(sample.points, return_closest_point=True)
    np.testing.assert_allclose(offsets.distances, np.linalg.norm(nearest - sample.points, axis=1), atol=1e-9)
    cosines = (peer.face_normals[faces] * sample.normals).sum(axis=1)
    assert np.mean(np.abs(offsets.cosines - cosines) < 1e-6) > 0.9  # a point nearest to an edge may take either face


def test_sample_lies_on_the_surface_uniformly():
    sample = Surface(cube(2.0)).sample(60_000, 0)
    np.testing.assert_allclose(np.abs(sample.points).max(axis=1), 1)
    np.testing.assert_allclose((sample.points * sample.normals).sum(axis=1), 1)
    shares = [np.mean(sample.normals[:, axis] == sign) for axis in range(3) for sign in (-1, 1)]
    np.testing.assert_allclose(shares, 1 / 6, atol=0.01)


def test_takes_single_precision_with_gradient():
    mesh = icosphere(2, 10.0, dtype=torch.float32)
    surface = Surface(mesh.with_vertices(mesh.vertices.requires_grad_()))
    assert surface.sample(10, 0).points.dtype == np.float64


def test_doors():
    there, back = both_ways(square(0.0), square(1.0), 10)
    for quantile in (-0.5, 0, 1.1, float("nan")):
        with pytest.raises(ValueError, match=r"in \(0, 1\] is needed"):
            hausdorff_distance(there, back, quantile)
    with pytest.raises(ValueError, match="n_points is 0"):
        Surface(square(0.0)).sample(0, 0)


def test_distances_of_vertices_from_a_larger_sphere():
    inner, outer = icosphere(2, 1.0), icosphere(5, 2.0)
    assert vertex_distances(inner, outer) == pytest.approx(np.ones(162), abs=2e-3)


def nearest_by_least_squares(point, corners):
    """The distance to a triangle as a problem of non-negative least squares: weights that sum to one."""
    heavy = 1e6
    matrix = np.vstack([corners.T, np.full(3, heavy)])
    weights = nnls(matrix, np.append(point, heavy))[0]
    return np.linalg.norm(weights / weights.sum() @ corners - point)


def test_offsets_against_a_slow_twin():
    mesh = folded_sphere(1)
    points = Surface(icosphere(1, 43.0)).sample(6, 0)
    found = Surface(mesh).offsets(points).distances
    corners = mesh.vertices[mesh.faces].numpy()
    slow = [min(nearest_by_least_squares(point, triangle) for triangle in corners) for point in points.points]
    np.testing.assert_allclose(found, slow, atol=1e-6)


def test_offsets_against_trimesh():
    one, other = Surface(folded_sphere(2)), icosphere(2, 41.0)
    sample = one.sample(200, 1)
    twin = trimesh.Trimesh(other.vertices.numpy(), other.faces.numpy(), process=False)
    places = trimesh.triangles.closest_point(
        np.repeat(twin.triangles[None], 200, axis=0).reshape(-1, 3, 3),
        np.repeat(sample.points, len(twin.faces), axis=0),
    )
    apart = np.linalg.norm(places.reshape(200, -1, 3) - sample.points[:, None], axis=2).min(axis=1)
    np.testing.assert_allclose(Surface(other).offsets(sample).distances, apart, atol=1e-9)


def test_parallel_planes_are_as_far_apart_as_they_were_shifted():
    """Shifted within themselves the planes agree but for a margin; across, by the shift: closed forms for squares."""
    plane = square(0.0)
    beside = plane.with_vertices(plane.vertices + torch.tensor([0.25, 0.0, 0.0]))
    there, back = both_ways(plane, beside, 200_000)
    # A quarter of each square sticks out, by 0 to 0.25.
    assert average_surface_distance(there, back) == pytest.approx(0.25**2 / 2, rel=0.02)
    assert hausdorff_distance(there, back) == pytest.approx(0.15, abs=0.003)
