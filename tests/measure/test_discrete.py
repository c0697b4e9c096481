"""Discrete encodings: what they are on shapes known by hand, their scales and limits, and their gradients."""

import math

import numpy as np
import ot
import pytest
import torch

from meshot import (
    Contour,
    DiscreteMeasure,
    Mesh,
    empirical,
    random_directions,
    sliced_wasserstein,
    surface,
    varifold,
)
from meshot.loss import VarifoldEncoding
from meshot.loss.transport import wasserstein
from meshot.measure.discrete import varifold_sample
from meshot.mesh.geometry import face_normals
from meshot.mesh.mesh import closed_contour
from meshot.mesh.shapes import cube, folded_sphere, icosphere, tetrahedron
from meshot_book.examples.memory import peak_saved_bytes
from refusals import refuses


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
    assert torch.equal(DiscreteMeasure(torch.zeros(n, 2, dtype=dtype)).weights, torch.full((n,), 1 / n, dtype=dtype))


ENCODINGS = {
    "surface": surface,
    "varifold": varifold,
    "empirical": lambda shape, **options: empirical(shape, 40, 0, **options),
    "varifold_sample": lambda shape, **options: varifold_sample(shape, 40, 0, **options),
}
every = pytest.mark.parametrize("encode", ENCODINGS.values(), ids=ENCODINGS)


@every
def test_one_order_of_coordinates(encode):
    """Features that repeat what is known must repeat it, scaled, wherever a point lies."""
    mesh = folded_sphere(1, 1.0, 0.3)
    normals = face_normals(mesh)
    measure = encode(mesh, normal_scale=2.0, features=mesh.vertices, face_features=normals, feature_scale=0.5)
    position, normal, vertex_part, face_part = measure.places.split(3, dim=1)
    assert torch.allclose(vertex_part, 0.5 * position, atol=1e-15)
    assert torch.allclose(face_part, 0.25 * normal, atol=1e-15)
    assert torch.allclose(normal.norm(dim=1), torch.tensor(2.0, dtype=torch.float64))


@every
def test_contours_take_the_same(encode):
    square = closed_contour(torch.tensor([[0.0, 0], [3, 0], [3, 1], [0, 1]], dtype=torch.float64))
    heights = torch.arange(4, dtype=torch.float64)[:, None]
    measure = encode(square, normal_scale=1.0, features=square.vertices, face_features=heights, feature_scale=3.0)
    position, normal, vertex_part, face_part = measure.places.split([2, 2, 2, 1], dim=1)
    assert torch.allclose(vertex_part, 3 * position)
    outward = torch.tensor([[0.0, -1], [1, 0], [0, 1], [-1, 0]], dtype=torch.float64)
    assert torch.equal(normal, outward[(face_part[:, 0] / 3).long()])


@pytest.mark.parametrize("scale", ["normal_scale", "feature_scale"])
@pytest.mark.parametrize("value", [-1.0, math.nan, math.inf])
@every
def test_scales_are_lengths(encode, scale, value):
    refuses(f"{scale} is {value}", encode, cube(), **{scale: value})


@every
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"features": torch.ones(3, 1, dtype=torch.float64)}, r"features has shape \(3, 1\); \(8, k\)"),
        ({"features": torch.ones(8, dtype=torch.float64)}, r"features has shape \(8,\)"),
        ({"features": torch.ones(8, 0, dtype=torch.float64)}, r"features has shape \(8, 0\)"),
        ({"features": torch.full((8, 1), math.nan, dtype=torch.float64)}, "features has 8 entries that are NaN"),
        ({"face_features": torch.ones(8, 1, dtype=torch.float64)}, r"face_features has shape \(8, 1\); \(12, k\)"),
        ({"features": torch.ones(8, 1)}, "torch.float32 on cpu, vertices torch.float64"),
    ],
)
def test_features_fit(unchecked, encode, arguments, message):
    refuses(message, encode, cube(), **arguments)


@every
@pytest.mark.parametrize(
    "shape",
    [Mesh(torch.zeros(3, 3), torch.tensor([[0, 1, 2]])), Contour(torch.zeros(2, 2), torch.tensor([[0, 1]]))],
    ids=["mesh", "contour"],
)
def test_shapes_without_size_are_refused(encode, shape):
    refuses("positive size", encode, shape)


@every
def test_features_carry_gradients(encode):
    mesh = tetrahedron()
    linear, constant = (torch.ones(4, 1, dtype=torch.float64, requires_grad=True) for _ in range(2))
    encode(mesh, features=linear, face_features=constant).places.sum().backward()
    assert float(linear.grad.sum()) > 0
    assert float(constant.grad.sum()) > 0


def test_a_feature_tells_apart_what_positions_cannot():
    """Two colourings of one sphere: half and half, exchanged. Positions agree; the colour must move by its scale."""
    sphere = icosphere(2)
    colour = (sphere.vertices[sphere.faces].mean(dim=1)[:, 2:] > 0).double()
    directions = torch.eye(4, dtype=torch.float64)
    pair = [surface(sphere, face_features=values, feature_scale=6.0) for values in (colour, 1 - colour)]
    value = float(sliced_wasserstein(*pair, directions))
    shares = surface(sphere).weights
    unequal = abs(float((shares * (2 * colour[:, 0] - 1)).sum()))
    assert value == pytest.approx(36 * unequal / 4, abs=1e-12)
    near = [
        varifold(sphere, normal_scale=0.0, face_features=values, feature_scale=0.1) for values in (colour, 1 - colour)
    ]
    assert float(wasserstein(*near)) == pytest.approx(0.01, abs=1e-12)  # recolouring is cheaper than moving


def test_the_continuous_measure_is_the_limit_of_samples():
    """10⁶ points per side: the mean and covariance of a folded surface with normals, within five standard errors."""
    mesh = folded_sphere(2, 1.0, 0.3)
    exact, points = surface(mesh, normal_scale=0.5), empirical(mesh, 1_000_000, 3, normal_scale=0.5).points
    corners = exact.vertices[exact.cells]
    centre = (exact.weights[:, None] * corners.mean(dim=1)).sum(dim=0)
    # ∫ x xᵀ over a triangle: (Σ vᵢvᵢᵀ + (Σ vᵢ)(Σ vᵢ)ᵀ) / 12.
    total = corners.sum(dim=1)
    second = torch.einsum("f,fci,fcj->ij", exact.weights, corners, corners) + torch.einsum(
        "f,fi,fj->ij", exact.weights, total, total
    )
    assert float((points.mean(dim=0) - centre).abs().max()) < 5 / 1000
    assert float((points.T @ points / len(points) - second / 12).abs().max()) < 5 / 1000


def test_varifold_transport_agrees_with_pot():
    pair = varifold(icosphere(1), normal_scale=0.5), varifold(folded_sphere(1, 1.2, 0.3), normal_scale=0.5)
    cost = ot.dist(*(m.points.numpy() for m in pair))
    expected = ot.emd2(*(m.weights.numpy() / m.weights.numpy().sum() for m in pair), cost)
    assert float(wasserstein(*pair)) == pytest.approx(expected, rel=1e-9)


def bent(reach: torch.Tensor) -> Contour:
    """An L: from (0, 1) down to the origin and right to (reach, 0)."""
    fixed = torch.tensor([[0.0, 1], [0, 0]], dtype=torch.float64)
    end = torch.stack([reach, torch.zeros_like(reach)])
    return Contour(torch.cat([fixed, end[None]]), torch.tensor([[0, 1], [1, 2]]))


def mean_x_slope(encode) -> float:
    reach = torch.tensor(1.0, dtype=torch.float64, requires_grad=True)
    measure = encode(bent(reach))
    centres = measure.places if measure.cells is None else measure.places[measure.cells].mean(dim=1)
    mean = (measure.weights * centres[:, 0]).sum()
    return float(torch.autograd.grad(mean, reach)[0])


@pytest.mark.parametrize(("detach", "expected"), [(True, 0.25), (False, 0.375 - 0.125 / 50)])
def test_fixed_draws_leave_out_how_probabilities_change(detach, expected):
    """The mean of x on an L with arms 1 and a is a²/(2(1 + a)): slope .375 at a = 1, of which points give .25."""
    slopes = [mean_x_slope(lambda s, g=g: empirical(s, 50, g, detach_weights=detach)) for g in range(150)]
    error = np.std(slopes, ddof=1) / math.sqrt(len(slopes))
    assert abs(np.mean(slopes) - expected) < 4 * error < 0.03


def test_the_other_encodings_know_it():
    for encode in (surface, varifold):
        assert mean_x_slope(encode) == pytest.approx(0.375, abs=1e-15)
        assert mean_x_slope(lambda s, e=encode: e(s, detach_weights=True)) == pytest.approx(0.25, abs=1e-15)


def test_carried_masses_are_equal_in_value():
    vertices = icosphere(1).vertices.requires_grad_()
    shape = icosphere(1).with_vertices(vertices)
    carried = empirical(shape, 50, 0)
    assert carried.weights.requires_grad
    assert torch.allclose(carried.weights.detach(), torch.full((50,), 0.02, dtype=torch.float64), atol=1e-16)
    (drift,) = torch.autograd.grad(carried.weights.sum(), vertices)
    assert float(drift.abs().max()) < 1e-15  # the total mass stays one
    detached = empirical(shape, 50, 0, detach_weights=True)
    assert torch.equal(carried.points, detached.points)
    assert torch.equal(carried.weights, detached.weights)
    assert not detached.weights.requires_grad


def test_faces_without_area_carry_no_mass():
    vertices = torch.tensor([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 0, 0]], dtype=torch.float64, requires_grad=True)
    mesh = Mesh(vertices, torch.tensor([[0, 1, 2], [0, 1, 3]]))
    assert varifold(mesh).weights.tolist() == [1, 0]
    for measure in (varifold(mesh), surface(mesh, normal_scale=1.0), empirical(mesh, 20, 0, detach_weights=False)):
        (gradient,) = torch.autograd.grad((measure.weights**2).sum() + measure.places.sum(), vertices)
        assert bool(torch.isfinite(gradient).all())


@every
def test_every_encoding_has_the_same_defaults(encode):
    vertices = cube(2.0).vertices.requires_grad_()
    shape = cube(2.0).with_vertices(vertices)
    by_default = encode(shape)
    assert by_default.places.shape[1] == 3  # no normals
    assert by_default.weights.requires_grad
    assert torch.equal(by_default.places, encode(shape, normal_scale=0.0).places)
    assert encode(shape, normal_scale=1.0).places.shape[1] == 6
    position, feature = encode(shape, features=shape.vertices).places.split(3, dim=1)
    torch.testing.assert_close(feature, position)
    assert not encode(shape, detach_weights=True).weights.requires_grad
    assert (VarifoldEncoding().normal_scale, VarifoldEncoding().detach_weights) == (0, False)


@every
def test_measures_move_to_another_type(unchecked, encode):
    measure = encode(cube())
    single = measure.to(torch.float32)
    assert type(single) is type(measure)
    assert single.places.dtype == single.weights.dtype == torch.float32
    assert torch.equal(single.places, measure.places.float())
    assert single.to("cpu", torch.float64).weights.dtype == torch.float64
    assert single.to(device="cpu").places.dtype == torch.float32
    refuses(r"torch\.int64; floating point is needed", measure.to, torch.int64)


def test_meshes_move_to_another_type(unchecked):
    assert cube().to("cpu", dtype=torch.float32).vertices.dtype == torch.float32
    refuses(r"torch\.int64; floating point is needed", cube().to, torch.int64)
