"""Distances, alignment and transport against closed forms and other libraries."""

import math
import warnings

import numpy as np
import ot
import pytest
import pyvista
import torch
from scipy.optimize import linear_sum_assignment
from scipy.spatial.transform import Rotation

from meshot.anatomy.templates import fsaverage5_surface
from meshot.mesh.mesh import Mesh
from meshot.mesh.shapes import cube, ellipsoid, folded_sphere, icosphere
from meshot.metrics.distances import (
    Surface,
    average_surface_distance,
    earth_movers_distance,
    half_sphere,
    hausdorff_distance,
    normal_agreement,
    rigidly_aligned,
    sinkhorn_distance,
    sliced_distance,
    vertex_distances,
)
from refusals import refuses


def both_ways(one, other, n_points=4000, seeds=(0, 1)):
    one, other = Surface(one), Surface(other)
    return other.offsets(one.sample(n_points, seeds[0])), one.offsets(other.sample(n_points, seeds[1]))


def square(height, turned=False):
    vertices = torch.tensor([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]).double()
    faces = torch.tensor([[0, 1, 2], [0, 2, 3]])
    return Mesh(vertices + torch.tensor([0, 0, height]), faces.flip(1) if turned else faces)


def test_a_square_that_is_shifted_and_turned_over():
    for turned, sign in ((False, 1), (True, -1)):
        offsets = both_ways(square(0.0), square(0.25, turned))
        assert average_surface_distance(*offsets) == pytest.approx(0.25)
        assert hausdorff_distance(*offsets) == pytest.approx(0.25)
        assert normal_agreement(*offsets) == pytest.approx(1)
        assert normal_agreement(*offsets, signed=True) == pytest.approx(sign)


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


def test_signed_distances_from_a_sphere_are_negative_inside():
    sphere = Surface(icosphere(5, radius=10.0))
    points = np.random.default_rng(0).normal(size=(200, 3))
    points *= np.linspace(1.0, 20.0, 200)[:, None] / np.linalg.norm(points, axis=1, keepdims=True)
    radii = np.linalg.norm(points, axis=1)
    # A sphere of triangles lies inside the round one, by 10 (1 - cos) of half an edge's angle at most.
    np.testing.assert_allclose(sphere.signed_distances(points), radii - 10, atol=0.01)
    nearest = sphere.nearest_faces(points)
    assert (np.einsum("nk,nk->n", sphere.normals[nearest], points) > 0.99 * radii).all()


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
        refuses(r"in \(0, 1\] is needed", hausdorff_distance, there, back, quantile)
    refuses("n_points is 0", Surface(square(0.0)).sample, 0, 0)


def test_distances_of_vertices_from_a_larger_sphere():
    inner, outer = icosphere(2, 1.0), icosphere(5, 2.0)
    assert vertex_distances(inner, outer) == pytest.approx(np.ones(162), abs=2e-3)


TURN = Rotation.from_rotvec(np.radians([4.0, -6.0, 8.0]))
SHIFT = np.array([3.0, -2.0, 4.0])


def moved(mesh, rotation=TURN, shift=SHIFT):
    return mesh.with_vertices(torch.from_numpy(rotation.apply(mesh.vertices.numpy()) + shift))


def worst(one, other):
    return float((one.vertices - other.vertices).norm(dim=1).max())


@pytest.mark.parametrize("make", [lambda: folded_sphere(4), lambda: ellipsoid(4, (40.0, 30.0, 50.0))])
def test_a_known_motion_is_undone(make):
    target = make()
    found = rigidly_aligned(moved(target), target, n_points=4000)
    assert worst(found.mesh, target) < 1e-4
    assert found.residue < 1e-5 < found.residues[0]
    np.testing.assert_allclose(found.rotation @ TURN.as_matrix(), np.eye(3), atol=1e-6)
    np.testing.assert_allclose(found.rotation @ SHIFT + found.translation, 0, atol=1e-4)
    assert found.turn_degrees == pytest.approx(math.sqrt(4**2 + 6**2 + 8**2), abs=1e-4)


def test_a_cortical_surface_comes_back():
    target = fsaverage5_surface("white", "left")
    found = rigidly_aligned(moved(target), target, n_points=3000)
    assert worst(found.mesh, target) < 1e-3
    assert (np.diff(found.residues) <= 1e-9).all()


def test_noise_stays_as_the_residue_and_hardly_turns():
    target = folded_sphere(4)
    noise = torch.from_numpy(np.random.default_rng(0).normal(scale=0.3, size=target.vertices.shape))
    source = moved(target.with_vertices(target.vertices + noise))
    found = rigidly_aligned(source, target, n_points=4000)
    exact = moved(source, TURN.inv(), TURN.inv().apply(-SHIFT))
    assert worst(found.mesh, exact) < 0.15  # of points as far as 46 mm from the centre
    # The nearest point of the faces is nearer than where the vertex came from; a face averages three of them.
    assert 0.1 < found.residue < 0.3


def test_nothing_to_do_is_done_at_once():
    target = folded_sphere(3)
    found = rigidly_aligned(target, target, n_points=500)
    assert len(found.residues) <= 3
    assert found.turn_degrees < 1e-5
    assert worst(found.mesh, target) < 1e-6


def test_it_takes_single_precision_and_repeats():
    target = folded_sphere(3)
    source = moved(target).to(torch.float32)
    one, again = (rigidly_aligned(source, target, n_points=800, generator=3) for _ in range(2))
    assert one.mesh.vertices.dtype == torch.float32
    assert torch.equal(one.mesh.vertices, again.mesh.vertices)
    assert one.mesh.faces is source.faces


def test_too_few_steps_are_said():
    target = folded_sphere(3)
    with pytest.warns(UserWarning, match="still move"):
        rigidly_aligned(moved(target), target, n_points=500, max_steps=1)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"max_steps": 0}, "max_steps is 0"),
        ({"tolerance": 0.0}, "tolerance is 0.0"),
        ({"n_points": 0}, "n_points is 0"),
    ],
)
def test_doors_of_alignment(arguments, words):
    with pytest.raises(ValueError, match=words):
        rigidly_aligned(folded_sphere(1), folded_sphere(1), **arguments)


def cloud(seed, n=200):
    return np.random.default_rng(seed).standard_normal((n, 3))


def test_translation():
    points, shift = cloud(0), np.array([3.0, -4.0, 12.0])
    assert earth_movers_distance(points, points + shift) == pytest.approx(13)
    assert sliced_distance(points, points + shift) == pytest.approx(13 / math.sqrt(3), rel=5e-3)


def test_blurred_transport():
    points, shift = cloud(0), np.array([3.0, -4.0, 12.0])
    assert sinkhorn_distance(points, points + shift, 0.1) == pytest.approx(13, rel=1e-3)
    assert sinkhorn_distance(points, points, 1.0) == pytest.approx(0, abs=1e-6)
    # A blur beyond the size of everything leaves the distance between the means.
    means = np.linalg.norm(cloud(1).mean(axis=0) - cloud(2).mean(axis=0))
    assert sinkhorn_distance(cloud(1), cloud(2), 1e3) == pytest.approx(means, rel=1e-3)
    refuses("blur is 0", sinkhorn_distance, points, points, 0.0)


def test_swd_against_pot_in_space():
    ours = sliced_distance(cloud(1), cloud(2), 50)
    theirs = ot.sliced_wasserstein_distance(cloud(1), cloud(2), projections=half_sphere(50).T)
    assert ours == pytest.approx(theirs)


def test_concentric_spheres_of_transport():
    # A uniform sphere projects to a uniform interval: SW₂² = (r − s)²/3.
    sphere = half_sphere(20_000) * np.where(np.arange(20_000) % 2, 1, -1)[:, None]
    assert sliced_distance(38 * sphere, 40 * sphere) == pytest.approx(2 / math.sqrt(3), rel=1e-3)


def test_half_sphere_is_isotropic():
    directions = half_sphere(200)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1)
    assert directions[:, 2].min() > 0
    np.testing.assert_allclose(directions.T @ directions / 200, np.eye(3) / 3, atol=2e-3)


@pytest.mark.parametrize("scale", 10.0 ** np.arange(-12, 13, 3))
def test_the_scale_and_the_place_do_not_matter(scale):
    """The tolerance of POT's solver is absolute; |x|² + |y|² − 2⟨x, y⟩ would cancel far from the origin."""
    squared = np.square(cloud(1)[:, None] - cloud(2)).sum(axis=2)
    expected = np.sqrt(squared[linear_sum_assignment(squared)].mean())
    assert earth_movers_distance(scale * cloud(1), scale * cloud(2)) == pytest.approx(scale * expected, rel=1e-9)
    # At 1e6 a coordinate keeps ten digits.
    moved = [cloud(seed) + 1e6 for seed in (1, 2)]
    assert earth_movers_distance(*moved) == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize("distance", [earth_movers_distance, sliced_distance])
def test_doors_of_transport(unchecked, distance):
    with pytest.raises(ValueError, match="200 and 199 points"):
        distance(cloud(0), cloud(0)[1:])
    with pytest.raises(ValueError, match="0 and 0 points"):
        distance(cloud(0)[:0], cloud(0)[:0])
    refuses("n_directions is 0", sliced_distance, cloud(0), cloud(0), 0)


def test_unfinished_transport(monkeypatch):
    monkeypatch.setattr(ot, "emd2", lambda *_, **__: warnings.warn("numItermax reached", stacklevel=2))
    with pytest.raises(ValueError, match="did not finish"):
        earth_movers_distance(cloud(0), cloud(1))
