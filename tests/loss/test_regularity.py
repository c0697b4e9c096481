"""Regularisers against closed forms, a slow twin, libigl, what must not change them, and their gradients."""

import itertools
import math

import igl
import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from meshot.loss.penalties import (
    cotangent_laplacian_length,
    laplacian_length,
    normal_inconsistency,
    squared_edge_length,
    squared_laplacian,
)
from meshot.mesh.geometry import face_normals, mesh_edges
from meshot.mesh.mesh import Contour, Mesh, closed_contour
from meshot.mesh.shapes import cube, folded_sphere, icosphere, regular_polygon, star, tetrahedron
from refusals import refuses

OF_BOTH = [squared_edge_length, squared_laplacian, laplacian_length, normal_inconsistency]
OF_MESHES = [*OF_BOTH, cotangent_laplacian_length]
#: By which power of the size each grows.
POWERS = dict(zip(OF_MESHES, (2, 2, 1, 0, 1), strict=True))


@pytest.mark.parametrize("n", [3, 4, 12])
def test_regular_polygon(n):
    contour = regular_polygon(n, 2.0)
    side = 4 * math.sin(math.pi / n)
    assert float(squared_edge_length(contour)) == pytest.approx(side**2)
    assert float(squared_edge_length(contour, 1.0)) == pytest.approx((side - 1) ** 2)
    # The mean of both neighbours lies on the same ray, at cos(2π/n) of the radius.
    inwards = 2 * (1 - math.cos(2 * math.pi / n))
    assert float(squared_laplacian(contour)) == pytest.approx(inwards**2)
    assert float(laplacian_length(contour)) == pytest.approx(inwards)
    assert float(normal_inconsistency(contour)) == pytest.approx(1 - math.cos(2 * math.pi / n))


def test_normals_see_every_turn():
    back_and_forth = closed_contour(torch.tensor([[0.0, 0], [1, 0], [0.5, 0]]))
    assert float(normal_inconsistency(back_and_forth)) == pytest.approx(4 / 3)


def test_the_order_of_edges_does_not_matter():
    contour = star(5, 1.5, 0.35)
    shuffled = Contour(contour.vertices, contour.edges[torch.tensor(np.random.default_rng(0).permutation(10))])
    for regulariser in OF_BOTH:
        torch.testing.assert_close(regulariser(shuffled), regulariser(contour))


def test_tetrahedron():
    mesh = tetrahedron()
    assert float(squared_edge_length(mesh)) == pytest.approx(8)
    assert float(squared_edge_length(mesh, math.sqrt(8))) == pytest.approx(0, abs=1e-20)
    # The three neighbours of v average to −v/3, with equal weights of either kind.
    assert float(squared_laplacian(mesh)) == pytest.approx((4 / 3) ** 2 * 3)
    assert float(laplacian_length(mesh)) == pytest.approx(4 / math.sqrt(3))
    assert float(cotangent_laplacian_length(mesh)) == pytest.approx(4 / math.sqrt(3))
    # Outward normals of a regular tetrahedron have cosine −1/3.
    assert float(normal_inconsistency(mesh)) == pytest.approx(4 / 3)


def test_cube():
    """12 edges turn by a right angle, 6 diagonals not at all; cotangents give the diagonals no weight."""
    mesh = cube(2.0)
    assert float(squared_edge_length(mesh)) == pytest.approx((12 * 4 + 6 * 8) / 18)
    assert float(normal_inconsistency(mesh)) == pytest.approx(12 / 18)
    # Three neighbours along the axes, each at distance 2: their mean is 2/3 (−1, −1, −1) away.
    assert float(cotangent_laplacian_length(mesh)) == pytest.approx(2 / math.sqrt(3))


@pytest.mark.parametrize("mesh", [cube(), folded_sphere(1, 40.0, 8.0)], ids=["cube", "folds"])
def test_slow_twins(mesh):
    """By loops over edges and faces; the cotangent weights by libigl."""
    v, faces = mesh.vertices.numpy(), mesh.faces.tolist()
    edges = mesh_edges(mesh).tolist()
    around = {i: {b if a == i else a for a, b in edges if i in (a, b)} for i in range(len(v))}
    lengths = [np.linalg.norm(np.mean([v[j] for j in around[i]], axis=0) - v[i]) for i in around]
    assert float(laplacian_length(mesh)) == pytest.approx(np.mean(lengths))
    normals = face_normals(mesh).numpy()
    pairs = [(a, b) for a, b in itertools.combinations(range(len(faces)), 2) if len({*faces[a]} & {*faces[b]}) == 2]
    turns = [1 - normals[a] @ normals[b] for a, b in pairs]
    assert float(normal_inconsistency(mesh)) == pytest.approx(np.mean(turns))
    matrix = igl.cotmatrix(v, mesh.faces.numpy())
    means = (matrix @ v) / -matrix.diagonal()[:, None]
    assert float(cotangent_laplacian_length(mesh)) == pytest.approx(np.linalg.norm(means, axis=1).mean())


@pytest.mark.parametrize("regulariser", OF_MESHES)
def test_motions_change_nothing_and_size_acts_as_a_power(regulariser):
    mesh = folded_sphere(1, 1.0, 0.3)
    turn = torch.from_numpy(Rotation.random(rng=np.random.default_rng(0)).as_matrix())
    value = regulariser(mesh)
    torch.testing.assert_close(regulariser(mesh.with_vertices(mesh.vertices @ turn.T + 7)), value)
    torch.testing.assert_close(regulariser(mesh.with_vertices(3 * mesh.vertices)), 3 ** POWERS[regulariser] * value)
    shuffled = mesh.faces[torch.from_numpy(np.random.default_rng(1).permutation(len(mesh.faces)))].roll(1, dims=1)
    torch.testing.assert_close(regulariser(Mesh(mesh.vertices, shuffled)), value)


@pytest.mark.parametrize("regulariser", OF_BOTH)
def test_gradients_on_contours(regulariser):
    generator = np.random.default_rng(0)
    vertices = star(4, 1.0, 0.5).vertices + torch.from_numpy(0.1 * generator.normal(size=(8, 2)))
    assert torch.autograd.gradcheck(lambda v: regulariser(closed_contour(v)), vertices.requires_grad_())


@pytest.mark.parametrize("regulariser", [*OF_MESHES, lambda m: squared_edge_length(m, 0.7)])
def test_gradients_on_meshes(regulariser):
    mesh = icosphere(0)
    vertices = mesh.vertices + torch.from_numpy(0.1 * np.random.default_rng(0).normal(size=(12, 3)))
    assert torch.autograd.gradcheck(lambda v: regulariser(mesh.with_vertices(v)), vertices.requires_grad_())


def test_detached_weights_keep_the_value_and_change_the_gradient():
    mesh = icosphere(0)
    jitter = 0.2 * torch.from_numpy(np.random.default_rng(0).normal(size=(12, 3)))
    vertices = (mesh.vertices + jitter).requires_grad_()
    values = [cotangent_laplacian_length(mesh.with_vertices(vertices), detach) for detach in (False, True)]
    torch.testing.assert_close(values[0], values[1])
    full, held = (torch.autograd.grad(value, vertices)[0] for value in values)
    assert float((full - held).norm()) > 0.1 * float(full.norm())
    # With the weights held, no vertex but itself and its neighbours has a gradient: the gradients add up to nothing.
    assert float(held.sum(dim=0).norm()) < 1e-12


def square(fold: float) -> Mesh:
    """Two faces of an open square, folded along their shared edge by an angle."""
    tip = [-math.cos(fold), 0.0, math.sin(fold)]
    vertices = torch.tensor([[0.0, 0, 0], [0, 1, 0], [1, 0, 0], tip], dtype=torch.float64)
    return Mesh(vertices, torch.tensor([[0, 2, 1], [0, 1, 3]]))


@pytest.mark.parametrize("fold", [0.0, 0.3, math.pi / 2, 3.0])
def test_a_fold_counts_by_its_angle_whichever_way_the_faces_run(fold):
    mesh = square(fold)
    expected = pytest.approx(1 - math.cos(fold), abs=1e-12)
    assert float(normal_inconsistency(mesh)) == expected
    turned = Mesh(mesh.vertices, torch.stack([mesh.faces[0], mesh.faces[1].flip(0)]))
    assert float(normal_inconsistency(turned)) == expected


def test_three_faces_at_an_edge_make_three_pairs():
    mesh = square(0.0)
    fin = torch.tensor([[0.0, 0.0, 1.0]], dtype=torch.float64)
    book = Mesh(torch.cat([mesh.vertices, fin]), torch.cat([mesh.faces, torch.tensor([[0, 1, 4]])]))
    # Flat to flat: 0; the fin stands at a right angle to both.
    assert float(normal_inconsistency(book)) == pytest.approx((0 + 1 + 1) / 3)


def test_cells_without_size_count_one_and_keep_gradients_finite():
    flat = torch.tensor([[0.0, 0, 0], [0, 1, 0], [1, 0, 0], [0, 0.5, 0]], dtype=torch.float64, requires_grad=True)
    mesh = Mesh(flat, torch.tensor([[0, 2, 1], [0, 1, 3]]))
    assert float(normal_inconsistency(mesh).detach()) == 1
    for regulariser in OF_MESHES:
        (gradient,) = torch.autograd.grad(regulariser(mesh), flat)
        assert bool(torch.isfinite(gradient).all())
    together = torch.zeros(3, 3, dtype=torch.float64, requires_grad=True)
    for regulariser in (squared_edge_length, lambda m: squared_edge_length(m, 1.0), cotangent_laplacian_length):
        (gradient,) = torch.autograd.grad(regulariser(Mesh(together, torch.tensor([[0, 1, 2]]))), together)
        assert float(gradient.norm()) == 0


def test_a_vertex_without_weights_lies_where_it_should():
    """Otherwise the value would grow with the distance from the origin."""
    flat = torch.tensor([[0.0, 0, 0], [1, 0, 0], [3, 0, 0]], dtype=torch.float64)
    mesh = tetrahedron()
    both = Mesh(torch.cat([mesh.vertices, flat]), torch.cat([mesh.faces, torch.tensor([[4, 5, 6]])]))
    for shift in (0, 1000):
        value = float(cotangent_laplacian_length(both.with_vertices(both.vertices + shift)))
        assert value == pytest.approx(4 / 7 * float(cotangent_laplacian_length(mesh)))


# In a training loop.


@pytest.mark.parametrize("regulariser", OF_MESHES)
def test_a_list_of_meshes_is_a_batch(regulariser):
    meshes = [Mesh(m.vertices.clone().requires_grad_(), m.faces) for m in (tetrahedron(), cube(2.0), icosphere(1))]
    vertices = [mesh.vertices for mesh in meshes]
    values = regulariser(meshes)
    assert values.shape == (3,)
    for value, mesh in zip(values, meshes, strict=True):
        assert float(value.detach()) == float(regulariser(mesh).detach())
    torch.testing.assert_close(regulariser(tuple(meshes), reduction="mean"), values.mean(), rtol=1e-15, atol=0)
    found = torch.autograd.grad(2 * values[1], vertices, allow_unused=True)
    (alone,) = torch.autograd.grad(regulariser(meshes[1]), vertices[1])
    assert (found[0], found[2]) == (None, None) or not bool(found[0].any() + found[2].any())
    torch.testing.assert_close(found[1], 2 * alone)


def test_the_mean_of_a_batch_counts_every_mesh_alike():
    """Not every edge: 8 for the tetrahedron, 16/3 for the cube, as PyTorch3D averages."""
    meshes = [tetrahedron(), cube(2.0)]
    assert float(squared_edge_length(meshes, reduction="mean")) == pytest.approx((8 + 96 / 18) / 2)
    contours = [regular_polygon(4, 2.0), regular_polygon(3, 2.0)]
    torch.testing.assert_close(squared_edge_length(contours), torch.tensor([8.0, 12.0]).double())
    torch.testing.assert_close(normal_inconsistency(contours), torch.tensor([1.0, 1.5]).double())


@pytest.mark.parametrize("regulariser", OF_MESHES)
def test_penalties_survive_what_a_loop_does(regulariser):
    """Half precision in mm, where squares exceed float16; autocast; a compiled step; and vmap over vertices."""
    mesh = icosphere(1, 1000.0)
    half = mesh.vertices.half().requires_grad_()
    value = regulariser(mesh.with_vertices(half))
    assert value.dtype == torch.float32
    assert float(value.detach()) == float(regulariser(mesh.with_vertices(half.detach().float())))
    assert torch.autograd.grad(value, half)[0].dtype == torch.float16
    single = mesh.vertices.float().requires_grad_()
    with torch.autocast("cpu", dtype=torch.bfloat16):
        assert torch.equal(regulariser(mesh.with_vertices(single)), regulariser(mesh.with_vertices(single)).float())
    plain = regulariser(mesh.with_vertices(single))
    assert torch.equal(torch.compile(lambda v: regulariser(mesh.with_vertices(v)), backend="eager")(single), plain)
    both = torch.stack([single.detach(), 2 * single.detach()])
    mapped = torch.vmap(lambda v: regulariser(mesh.with_vertices(v)))(both)
    torch.testing.assert_close(mapped, regulariser([mesh.with_vertices(v) for v in both]), rtol=1e-6, atol=0)


def test_bad_batches_are_refused(unchecked):
    mesh, contour = icosphere(0), regular_polygon(4, 1.0)
    refuses(
        "shape 0 is a Tensor; a Mesh or Contour is needed: mesh.with_vertices", laplacian_length, torch.ones(2, 5, 3)
    )
    refuses("shape 1 is a NoneType", squared_laplacian, [mesh, None])
    refuses("shape 0 is a Contour; a Mesh is needed", cotangent_laplacian_length, contour)
    refuses("an empty list", squared_edge_length, [])
    refuses("reduction is 'sum'; one of none, mean", normal_inconsistency, [mesh], reduction="sum")
    refuses("differ in dtype or device", laplacian_length, [mesh, mesh.to(torch.float32)])


def test_doors():
    lonely = Contour(torch.zeros(3, 2), torch.tensor([[0, 1]]))
    for regulariser in (squared_laplacian, laplacian_length):
        refuses("vertex 2 belongs to no edge", regulariser, lonely)
    refuses("exactly one edge in", normal_inconsistency, lonely)
    triangle = Mesh(torch.eye(3), torch.tensor([[0, 1, 2]]))
    refuses("no two faces of the mesh share an edge", normal_inconsistency, triangle)
    for length in (-1.0, math.nan, math.inf):
        refuses("target_length is", squared_edge_length, triangle, length)
    unused = Mesh(torch.cat([torch.eye(3), torch.zeros(1, 3)]), torch.tensor([[0, 1, 2]]))
    refuses("vertex 3 belongs to no face", cotangent_laplacian_length, unused)
