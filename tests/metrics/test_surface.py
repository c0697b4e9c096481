import numpy as np
import pytest
import pyvista
import torch

from meshot.mesh.mesh import Mesh
from meshot.mesh.shapes import cube, folded_sphere, icosphere
from meshot.metrics.surface import (
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
    for quantile in (0, 1.1, float("nan")):
        with pytest.raises(ValueError, match=r"in \(0, 1\] is needed"):
            hausdorff_distance(there, back, quantile)
    with pytest.raises(ValueError, match="n_points is 0"):
        Surface(square(0.0)).sample(0, 0)


def test_distances_of_vertices_from_a_larger_sphere():
    inner, outer = icosphere(2, 1.0), icosphere(5, 2.0)
    assert vertex_distances(inner, outer) == pytest.approx(np.ones(162), abs=2e-3)
