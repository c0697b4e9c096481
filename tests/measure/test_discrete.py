"""The encodings: what they are on shapes known by hand, and their gradients."""

import math

import numpy as np
import pytest
import torch

from meshot import Contour, DiscreteMeasure, Mesh, empirical, random_directions, sliced_wasserstein, varifold
from meshot.measure.discrete import varifold_sample
from meshot.mesh.mesh import closed_contour
from meshot.mesh.shapes import icosphere
from meshot_book.examples.memory import peak_saved_bytes


def triangle() -> Mesh:
    """A triangle of area 2 in the plane z = 1, and one of area 6 in the plane x = 0, far away."""
    vertices = [[0.0, 0, 1], [2, 0, 1], [0, 2, 1], [0, 10, 0], [0, 13, 0], [0, 10, 4]]
    return Mesh(torch.tensor(vertices, dtype=torch.float64), torch.tensor([[0, 1, 2], [3, 4, 5]]))


def test_varifold_by_hand():
    measure = varifold(triangle(), normal_scale=5.0)
    expected = torch.tensor([[2 / 3, 2 / 3, 1, 0, 0, 5], [0, 11, 4 / 3, 5, 0, 0]], dtype=torch.float64)
    assert torch.allclose(measure.points, expected)
    assert torch.allclose(measure.weights, torch.tensor([0.25, 0.75], dtype=torch.float64))


def test_varifold_of_a_square():
    square = closed_contour(torch.tensor([[0.0, 0], [3, 0], [3, 1], [0, 1]], dtype=torch.float64))
    measure = varifold(square, normal_scale=1.0)
    assert torch.equal(measure.points[0], torch.tensor([1.5, 0, 0, -1], dtype=torch.float64))
    assert torch.allclose(measure.weights, torch.tensor([3.0, 1, 3, 1], dtype=torch.float64) / 8)


def test_varifold_of_a_sphere_points_outward():
    sphere = icosphere(3, 2.0)
    measure = varifold(sphere, normal_scale=1.0)
    places, normals = measure.points.split(3, dim=1)
    cosine = (places / places.norm(dim=1, keepdim=True) * normals).sum(dim=1)
    assert float(cosine.min()) > 0.99


def test_empirical_has_equal_masses_on_the_shape():
    measure = empirical(triangle(), 400, 0)
    assert torch.equal(measure.weights, torch.full((400,), 1 / 400, dtype=torch.float64))
    on_first = (measure.points[:, 2] == 1) & (measure.points[:, 0] + measure.points[:, 1] <= 2 + 1e-12)
    share = float(on_first.double().mean())
    assert abs(share - 0.25) < 4 * math.sqrt(0.25 * 0.75 / 400)


def test_gradients_of_the_varifold():
    mesh = triangle()
    vertices = mesh.vertices + 0.1 * torch.from_numpy(np.random.default_rng(0).standard_normal((6, 3)))

    def encoded(v):
        measure = varifold(mesh.with_vertices(v), normal_scale=0.7)
        return measure.points, measure.weights

    assert torch.autograd.gradcheck(encoded, vertices.requires_grad_())


def test_weights_can_be_detached():
    vertices = triangle().vertices.requires_grad_()
    mesh = triangle().with_vertices(vertices)
    assert varifold(mesh).weights.requires_grad
    assert not varifold(mesh, detach_weights=True).weights.requires_grad
    assert varifold(mesh, detach_weights=True).points.requires_grad


def test_float32_stays_float32():
    measure = varifold(icosphere(3).to(torch.float32))
    assert measure.points.dtype == measure.weights.dtype == torch.float32


def test_shapes_without_size_are_refused():
    flat = Mesh(torch.zeros(3, 3), torch.tensor([[0, 1, 2]]))
    with pytest.raises(ValueError, match="positive size"):
        varifold(flat)
    with pytest.raises(ValueError, match="positive size"):
        empirical(flat, 3, 0)
    with pytest.raises(ValueError, match="normal_scale"):
        varifold(triangle(), normal_scale=-1)
    with pytest.raises(ValueError, match="positive size"):
        varifold(Contour(torch.zeros(2, 2), torch.tensor([[0, 1]])))


def test_equal_masses_by_default():
    measure = DiscreteMeasure(torch.zeros(8, 3))
    assert torch.equal(measure.weights, torch.full((8,), 0.125))
    assert "8 points in R^3" in repr(measure)


def test_a_sample_of_the_varifold_is_made_of_its_faces_in_proportion_to_their_areas():
    whole, drawn = varifold(triangle(), normal_scale=5.0), varifold_sample(triangle(), 400, 0, normal_scale=5.0)
    assert torch.equal(drawn.weights, torch.full((400,), 1 / 400, dtype=torch.float64))
    is_first, is_second = ((drawn.points == row).all(dim=1) for row in whole.points)
    assert bool((is_first | is_second).all())
    assert abs(float(is_first.double().mean()) - 0.25) < 4 * math.sqrt(0.25 * 0.75 / 400)


def test_a_sample_of_the_varifold_of_a_contour_and_with_features():
    square = closed_contour(torch.tensor([[0.0, 0], [3, 0], [3, 1], [0, 1]], dtype=torch.float64))
    assert set(map(tuple, varifold_sample(square, 50, 0).points.tolist())) <= set(
        map(tuple, varifold(square).points.tolist())
    )
    of_faces = torch.tensor([[1.0], [2.0]], dtype=torch.float64)
    drawn = varifold_sample(
        triangle(), 50, 0, normal_scale=1.0, face_features=of_faces, features=torch.zeros(6, 2).double()
    )
    assert drawn.points.shape == (50, 9)
    assert torch.equal(drawn.points[:, 8] == 1, drawn.points[:, 2] == 1)
    with pytest.raises(ValueError, match="face_features"):
        varifold_sample(triangle(), 50, 0, face_features=of_faces[:1])


def test_the_mean_gradient_of_varifold_samples_is_that_of_the_varifold():
    def gradient(encode):
        vertices = triangle().vertices.requires_grad_()
        measure = encode(triangle().with_vertices(vertices))
        value = measure.weights @ (measure.points @ torch.arange(1.0, 7, dtype=torch.float64)).square()
        return torch.autograd.grad(value, vertices)[0]

    def mean_gradient(detach):
        return (
            sum(
                gradient(lambda m, s=s: varifold_sample(m, 50, s, normal_scale=3.0, detach_weights=detach))
                for s in range(200)
            )
            / 200
        )

    whole, stopped = (
        gradient(lambda m: varifold(m, normal_scale=3.0)),
        gradient(lambda m: varifold(m, normal_scale=3.0, detach_weights=True)),
    )
    assert float((whole - stopped).norm() / whole.norm()) > 0.2  # there is something to tell apart
    assert float((mean_gradient(False) - whole).norm() / whole.norm()) < 0.06
    assert float((mean_gradient(True) - stopped).norm() / stopped.norm()) < 0.06
    assert not varifold_sample(triangle(), 5, 0, detach_weights=True).weights.requires_grad


def test_memory_for_a_sample_of_the_varifold_does_not_grow_with_the_mesh():
    def held(subdivisions):
        mesh = icosphere(subdivisions)
        vertices = mesh.vertices.requires_grad_()
        target = varifold(icosphere(1), normal_scale=1.0)

        def step():
            sliced_wasserstein(
                varifold_sample(mesh.with_vertices(vertices), 100, 0, normal_scale=1.0),
                target,
                random_directions(4, 6, 0),
            ).backward()

        return peak_saved_bytes(step)

    assert held(5) == held(3)


@pytest.mark.parametrize("dtype", [torch.float16, torch.bfloat16, torch.float32, torch.float64])
@pytest.mark.parametrize("n", [3, 7, 49, 1000])
def test_equal_masses_are_those_of_a_measure_in_every_dtype(dtype, n):
    assert DiscreteMeasure(torch.zeros(n, 2, dtype=dtype)).weights.dtype == dtype


@pytest.mark.parametrize(("dtype", "allowed"), [(torch.float32, 1e-5), (torch.float64, 1e-5)])
def test_how_far_from_one_a_sum_may_be(dtype, allowed):
    points = torch.zeros(2, 1, dtype=dtype)
    for off in (-allowed, allowed):
        DiscreteMeasure(points, torch.tensor([0.5, 0.5 + 0.98 * off], dtype=dtype))
        with pytest.raises(ValueError, match="sum to"):
            DiscreteMeasure(points, torch.tensor([0.5, 0.5 + 1.02 * off], dtype=dtype))


def test_a_feature_is_worth_its_own_number_by_default():
    mesh = icosphere(1)
    for encode in (lambda **given: empirical(mesh, 20, 0, **given), lambda **given: varifold(mesh, **given)):
        plain = encode(features=mesh.vertices)
        assert torch.equal(plain.points, encode(features=mesh.vertices, feature_scale=1.0).points)
    assert torch.equal(*empirical(mesh, 20, 0, features=mesh.vertices).points.split(3, dim=1))
