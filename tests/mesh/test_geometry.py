"""Lengths, areas, curvatures, samples, sections and moments: closed forms, trimesh, libigl, and gradients."""

import math

import igl
import numpy as np
import pytest
import torch
import trimesh
from hypothesis import given, settings, strategies as st
from scipy import stats

from meshot import Mesh
from meshot.mesh import geometry
from meshot.mesh.geometry import (
    cotangent_vectors,
    cotangents,
    even_points,
    face_areas,
    gaussian_curvatures,
    mean_curvatures,
    plane_section,
    sample_locations,
    sample_points,
    solid_moments,
    umbrella_vectors,
    vertex_areas,
)
from meshot.mesh.mesh import Contour, closed_contour
from meshot.mesh.shapes import cube, folded_sphere, icosphere, tetrahedron
from refusals import refuses

SQUARE = closed_contour(torch.tensor([[0.0, 0], [2, 0], [2, 2], [0, 2]], dtype=torch.float64))


def bumpy() -> Mesh:
    sphere = trimesh.creation.icosphere(subdivisions=2)
    vertices = sphere.vertices * (1 + 0.2 * np.random.default_rng(0).random((len(sphere.vertices), 1)))
    return Mesh(torch.from_numpy(vertices), torch.from_numpy(np.array(sphere.faces)))


def test_against_trimesh():
    mesh = bumpy()
    other = trimesh.Trimesh(mesh.vertices.numpy(), mesh.faces.numpy(), process=False)
    assert np.allclose(geometry.face_areas(mesh), other.area_faces)
    assert np.allclose(geometry.face_normals(mesh), other.face_normals)
    assert np.allclose(geometry.face_barycentres(mesh), other.triangles_center)
    assert float(geometry.signed_volume(mesh)) == pytest.approx(other.volume)
    assert float(geometry.signed_volume(Mesh(mesh.vertices, mesh.faces.flip(1)))) == pytest.approx(-other.volume)
    assert np.array_equal(geometry.mesh_edges(mesh), np.unique(np.sort(other.edges_unique, axis=1), axis=0))
    assert float(geometry.edge_lengths(mesh).sum()) == pytest.approx(other.edges_unique_length.sum())


def test_vertex_areas_against_libigl():
    mesh = icosphere(2)
    mesh = mesh.with_vertices(mesh.vertices * torch.tensor([1.0, 2.0, 3.0], dtype=torch.float64))
    diagonal = igl.massmatrix(mesh.vertices.numpy(), mesh.faces.numpy(), igl.MASSMATRIX_TYPE_BARYCENTRIC).diagonal()
    np.testing.assert_allclose(geometry.vertex_areas(mesh), diagonal, rtol=1e-12)


def test_volume_does_not_depend_on_place():
    mesh = bumpy()
    far = mesh.with_vertices(mesh.vertices + 1e4)
    assert float(geometry.signed_volume(far)) == pytest.approx(float(geometry.signed_volume(mesh)), rel=1e-9)


def test_square_by_hand():
    assert torch.equal(geometry.edge_lengths(SQUARE), torch.full((4,), 2.0, dtype=torch.float64))
    assert torch.equal(geometry.edge_midpoints(SQUARE)[0], torch.tensor([1.0, 0], dtype=torch.float64))
    assert torch.equal(geometry.edge_normals(SQUARE)[0], torch.tensor([0.0, -1], dtype=torch.float64))


@pytest.mark.parametrize(
    "quantity", [geometry.face_areas, geometry.face_normals, geometry.signed_volume, geometry.edge_lengths]
)
def test_gradients(quantity):
    mesh = tetrahedron()
    vertices = mesh.vertices + 0.1 * torch.from_numpy(np.random.default_rng(1).standard_normal((4, 3)))
    assert torch.autograd.gradcheck(lambda v: quantity(mesh.with_vertices(v)), vertices.requires_grad_())


def test_a_face_without_area_gives_zeros_and_finite_gradients():
    vertices = torch.zeros(3, 3, dtype=torch.float64, requires_grad=True)
    mesh = Mesh(vertices, torch.tensor([[0, 1, 2]]))
    total = geometry.face_areas(mesh).sum() + geometry.face_normals(mesh).sum()
    total.backward()
    assert float(total.detach()) == 0
    assert torch.equal(vertices.grad, torch.zeros(3, 3, dtype=torch.float64))


def test_vertex_normals_of_a_sphere_are_radial_and_zero_where_faces_cancel():
    ball = icosphere(3, radius=5.0)
    assert float((geometry.vertex_normals(ball) * ball.vertices / 5).sum(dim=1).min()) > 0.999
    sheet = Mesh(torch.tensor([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), torch.tensor([[0, 1, 2], [0, 2, 1]]))
    assert not geometry.vertex_normals(sheet).any()


def ridge() -> Mesh:
    """An open mesh: two faces that share an edge, one of them obtuse."""
    vertices = torch.tensor([[0.0, 0, 0], [2, 0, 0], [1, 2, 0.5], [1, -0.2, 0.1]], dtype=torch.float64)
    return Mesh(vertices, torch.tensor([[0, 1, 2], [1, 0, 3]]))


@pytest.mark.parametrize("mesh", [tetrahedron(), cube(), ridge(), folded_sphere(2, 40.0, 8.0)], ids=lambda m: repr(m))
def test_cotangent_vectors_agree_with_libigl(mesh):
    matrix = igl.cotmatrix(mesh.vertices.numpy(), mesh.faces.numpy())
    sums, totals = cotangent_vectors(mesh)
    np.testing.assert_allclose(sums.numpy(), matrix @ mesh.vertices.numpy(), atol=1e-10)
    np.testing.assert_allclose(totals.numpy(), -matrix.diagonal(), atol=1e-12)


def test_angles_of_known_triangles():
    right = Mesh(torch.tensor([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), torch.tensor([[0, 1, 2]]))
    torch.testing.assert_close(cotangents(right), torch.tensor([[0.0, 1, 1]]))
    torch.testing.assert_close(cotangents(tetrahedron()), torch.full((4, 3), 1 / math.sqrt(3), dtype=torch.float64))


@pytest.mark.parametrize("radius", [0.5, 40.0])
def test_a_sphere_has_curvature_one_over_its_radius(radius):
    errors = []
    for level in (2, 3, 4):
        mesh = icosphere(level, radius)
        errors.append(float((mean_curvatures(mesh) * radius - 1).abs().mean()))
    assert errors[2] < 0.005
    assert errors[0] > 2 * errors[1] > 4 * errors[2]


def test_curvature_adds_up_to_area_over_radius_exactly():
    """Σ ⟨∇A, x⟩ = 2 A because area grows with the square of the size; on an icosahedron every ∇A is along x."""
    mesh = icosphere(0, 3.0)
    assert float(mean_curvatures(mesh).mean()) == pytest.approx(1 / 3, rel=1e-12)


def test_inside_a_plane_cotangents_see_nothing_and_the_mean_of_neighbours_does():
    """A fan around an uneven interior vertex."""
    angles = np.array([0.0, 0.7, 2.0, 3.3, 4.9])
    rim = np.stack([2 * np.cos(angles), 3 * np.sin(angles), 0 * angles], axis=1)
    vertices = torch.from_numpy(np.concatenate([[[0.3, 0.1, 0]], rim]))
    mesh = Mesh(vertices, torch.tensor([[0, k, k % 5 + 1] for k in range(1, 6)]))
    assert float(cotangent_vectors(mesh)[0][0].norm()) < 1e-12
    assert float(umbrella_vectors(mesh)[0].norm()) > 0.1


def test_a_face_without_area_has_no_angles_and_a_finite_gradient():
    vertices = torch.tensor([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [1, 1, 0]], dtype=torch.float64, requires_grad=True)
    mesh = Mesh(vertices, torch.tensor([[0, 1, 2], [0, 2, 3]]))
    assert cotangents(mesh)[0].tolist() == [0, 0, 0]
    cotangent_vectors(mesh)[0].square().sum().backward()
    assert bool(torch.isfinite(vertices.grad).all())
    alone = Mesh(vertices.detach(), torch.tensor([[0, 1, 2], [1, 0, 2]]))
    refuses("vertex 3 belongs to no face", mean_curvatures, alone)
    flat = Mesh(vertices.detach()[:3], torch.tensor([[0, 1, 2]]))
    assert mean_curvatures(flat).tolist() == [0, 0, 0]


def uneven_mesh() -> Mesh:
    """A fan of faces with areas from zero (the first and the last) to large."""
    x = torch.tensor([0.0, 0.0, 1.0, 3.0, 3.5, 8.0, 8.0], dtype=torch.float64)
    rim = torch.stack([x, torch.zeros_like(x), torch.zeros_like(x)], dim=1)
    apex = torch.tensor([[2.0, 1, 1]], dtype=torch.float64)
    first = torch.arange(6)
    return Mesh(torch.cat([rim, apex]), torch.stack([first, first + 1, torch.full((6,), 7)], dim=1))


def test_faces_are_hit_by_area():
    mesh = uneven_mesh()
    cells, barycentric = sample_locations(mesh, 20_000, 0)
    areas = face_areas(mesh)
    counts = np.bincount(cells.numpy(), minlength=len(areas))
    expected = (areas / areas.sum() * 20_000).numpy()
    assert counts[expected == 0].sum() == 0
    positive = expected > 0
    assert stats.chisquare(counts[positive], expected[positive]).pvalue > 0.01
    assert torch.allclose(barycentric.sum(dim=1), torch.ones(20_000, dtype=torch.float64))
    assert float(barycentric.min()) >= 0


def test_points_are_uniform_on_a_triangle():
    triangle = Mesh(torch.eye(3, dtype=torch.float64), torch.tensor([[0, 1, 2]]))
    barycentric = sample_points(triangle, 20_000, 1)
    # Each barycentric coordinate of a uniform point has the Beta(1, 2) law.
    for coordinate in barycentric.T:
        assert stats.kstest(coordinate.numpy(), stats.beta(1, 2).cdf).pvalue > 0.01


def test_points_are_uniform_on_a_contour():
    points = sample_points(SQUARE, 20_000, 2)
    on_edge = (points == 0) | (points == 2)
    assert bool(on_edge.any(dim=1).all())
    bottom = points[points[:, 1] == 0][:, 0]
    assert stats.kstest(bottom.numpy(), stats.uniform(0, 2).cdf).pvalue > 0.01


def test_a_seed_repeats_and_points_follow_the_vertices():
    mesh = uneven_mesh()
    assert torch.equal(sample_points(mesh, 50, 3), sample_points(mesh, 50, 3))
    moved = mesh.with_vertices(mesh.vertices + 5)
    assert torch.allclose(sample_points(moved, 50, 3), sample_points(mesh, 50, 3) + 5)
    vertices = mesh.vertices.clone().requires_grad_()
    sample_points(mesh.with_vertices(vertices), 50, 3).sum().backward()
    assert float(vertices.grad.sum()) == pytest.approx(150)


def test_even_points_are_even():
    points = even_points(SQUARE, 16)
    gaps = (points - points.roll(-1, 0)).abs().sum(dim=1)
    assert torch.allclose(gaps, torch.full((16,), 0.5, dtype=torch.float64))
    assert torch.equal(even_points(SQUARE, 4, offset=0), SQUARE.vertices)


def test_even_points_skip_edges_without_length():
    vertices = torch.tensor([[0.0, 0], [0, 0], [1, 0], [0, 1]], dtype=torch.float64)
    points = even_points(closed_contour(vertices), 7)
    assert bool(torch.isfinite(points).all())


@pytest.mark.parametrize("n_points", [0, -3, 2.5])
def test_counts_are_checked(unchecked, n_points):
    refuses("n_points", sample_points, SQUARE, n_points, 0)
    refuses("n_points", even_points, SQUARE, n_points)


def test_a_shape_without_size_cannot_be_sampled():
    point = Contour(torch.ones(2, 2), torch.tensor([[0, 1]]))
    refuses("positive size", sample_points, point, 5, 0)
    refuses("no length", even_points, point, 5)
    refuses(r"\[0, 1\)", even_points, SQUARE, 5, offset=1.0)


DOUBLE = torch.float64


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_sphere_is_cut_in_a_circle_of_the_right_radius_and_length(axis):
    centre = torch.tensor([3.0, -2.0, 5.0], dtype=DOUBLE)
    height = 0.6
    segments = plane_section(icosphere(5, 10.0, tuple(centre.tolist())), axis, float(centre[axis]) + 10 * height)
    away = segments - centre
    assert torch.allclose(away[..., axis], torch.full_like(away[..., axis], 10 * height), atol=1e-12)
    radius = math.sqrt(10**2 - 6**2)
    distances = away[..., [i for i in range(3) if i != axis]].norm(dim=-1)
    # Chords lie inside the sphere: the sagitta of the longest edge (.38) is .0018, doubled by the oblique cut.
    assert float(distances.max()) <= radius + 1e-9
    assert float(distances.min()) > radius - 0.005
    length = (segments[:, 1] - segments[:, 0]).norm(dim=-1).sum()
    assert float(length) == pytest.approx(2 * math.pi * radius, rel=1e-3)


def test_a_plane_beside_the_surface_cuts_nothing():
    assert plane_section(icosphere(1), 0, 1.5).shape == (0, 2, 3)


@settings(max_examples=30)
@given(position=st.one_of(st.floats(-0.99, 0.99), st.sampled_from([0.0, 1 / math.sqrt(1.25 + math.sqrt(1.25))])))
def test_a_closed_surface_gives_closed_lines_even_through_its_vertices(position):
    """Every end of a segment is met by another end."""
    ends = plane_section(icosphere(2), 2, position).reshape(-1, 3)
    gaps = torch.cdist(ends, ends, compute_mode="donot_use_mm_for_euclid_dist") + 9 * torch.eye(len(ends), dtype=DOUBLE)
    assert float(gaps.min(dim=1).values.max()) < 1e-12


def test_the_gradient_reaches_the_vertices():
    mesh = icosphere(1)
    moving = mesh.with_vertices(mesh.vertices.clone().requires_grad_())
    plane_section(moving, 1, 0.1).sum().backward()
    assert bool((moving.vertices.grad != 0).any())


def test_an_axis_that_does_not_exist_is_refused():
    refuses("axis is 3", plane_section, icosphere(0), 3, 0.0)


def test_an_uneven_body_as_trimesh_has_it():
    mesh = icosphere(3, 5.0, (1.0, 2.0, 3.0))
    bent = mesh.with_vertices(mesh.vertices * torch.tensor([1.0, 2.0, 0.5]) + 0.03 * mesh.vertices.square().flip(1))
    volume, mean, covariance = solid_moments(bent)
    other = trimesh.Trimesh(bent.vertices.numpy(), bent.faces.numpy(), process=False)
    assert float(volume) == pytest.approx(other.volume, rel=1e-9)
    np.testing.assert_allclose(mean.numpy(), other.center_mass, rtol=1e-9)
    inertia = other.moment_inertia / other.volume
    np.testing.assert_allclose(covariance.numpy(), np.trace(inertia) / 2 * np.eye(3) - inertia, rtol=1e-8, atol=1e-9)


def test_gradients_of_solid():
    mesh = icosphere(0, 1.0, (0.3, 0.1, 0.2))
    vertices = (mesh.vertices * torch.tensor([1.0, 1.3, 0.7])).requires_grad_()
    assert torch.autograd.gradcheck(lambda v: solid_moments(mesh.with_vertices(v)), vertices)


def test_a_body_turned_inside_out_is_refused():
    mesh = icosphere(1, 1.0)
    with pytest.raises(ValueError, match="closed mesh with outward normals"):
        solid_moments(Mesh(mesh.vertices, mesh.faces.flip(1)))


@pytest.mark.parametrize("mesh", [cube(), bumpy(), folded_sphere(3)], ids=["cube", "bumpy", "folded"])
def test_gaussian_curvature_adds_up_to_the_euler_number(mesh):
    """Gauss and Bonnet: 4π on every surface with the topology of a sphere. libigl finds the same at every vertex."""
    found = gaussian_curvatures(mesh)
    assert float((found * vertex_areas(mesh)).sum()) == pytest.approx(4 * math.pi, rel=1e-12)
    defects = igl.gaussian_curvature(mesh.vertices.numpy(), mesh.faces.numpy())
    np.testing.assert_allclose((found * vertex_areas(mesh)).numpy(), defects, atol=1e-9)


def test_gaussian_curvature_of_a_saddle_is_negative_and_of_a_sphere_one_over_its_square():
    assert float(gaussian_curvatures(icosphere(4, radius=5.0)).mean()) == pytest.approx(1 / 25, rel=0.01)
    x, y = torch.meshgrid(torch.linspace(-1, 1, 9), torch.linspace(-1, 1, 9), indexing="ij")
    points = torch.stack([x, y, 0.1 * (x**2 - y**2)], dim=-1).reshape(-1, 3).double()
    at = torch.arange(81).reshape(9, 9)
    faces = torch.stack([at[:-1, :-1], at[1:, :-1], at[1:, 1:]], dim=-1).reshape(-1, 3)
    faces = torch.cat([faces, torch.stack([at[:-1, :-1], at[1:, 1:], at[:-1, 1:]], dim=-1).reshape(-1, 3)])
    assert float(gaussian_curvatures(Mesh(points, faces))[40]) == pytest.approx(-0.04, rel=0.05)


def test_a_vertex_without_area_has_no_gaussian_curvature():
    flat = Mesh(torch.zeros(3, 3).double(), torch.tensor([[0, 1, 2]]))
    assert gaussian_curvatures(flat).tolist() == [0, 0, 0]
