"""What the three encodings share: one order of coordinates, one set of scales, one limit."""

import inspect
import math

import numpy as np
import ot
import pytest
import torch

from meshot import Contour, Mesh, empirical, sliced_wasserstein, surface, triangulate, varifold
from meshot.loss import VarifoldEncoding
from meshot.loss.transport import wasserstein
from meshot.measure.discrete import varifold_sample
from meshot.mesh.geometry import face_normals
from meshot.mesh.mesh import closed_contour
from meshot.mesh.shapes import cube, folded_sphere, icosphere, tetrahedron

ENCODINGS = {
    "surface": surface,
    "varifold": varifold,
    "empirical": lambda shape, **options: empirical(shape, 40, 0, **options),
    "varifold_sample": lambda shape, **options: varifold_sample(shape, 40, 0, **options),
}
every = pytest.mark.parametrize("encode", ENCODINGS.values(), ids=ENCODINGS)


def places(measure) -> torch.Tensor:
    return measure.places


@every
def test_one_order_of_coordinates(encode):
    """Features that repeat what is known must repeat it, scaled, wherever a point lies."""
    mesh = folded_sphere(1, 1.0, 0.3)
    normals = face_normals(mesh)
    measure = encode(mesh, normal_scale=2.0, features=mesh.vertices, face_features=normals, feature_scale=0.5)
    position, normal, vertex_part, face_part = places(measure).split(3, dim=1)
    assert torch.allclose(vertex_part, 0.5 * position, atol=1e-15)
    assert torch.allclose(face_part, 0.25 * normal, atol=1e-15)
    assert torch.allclose(normal.norm(dim=1), torch.tensor(2.0, dtype=torch.float64))


@every
def test_contours_take_the_same(encode):
    square = closed_contour(torch.tensor([[0.0, 0], [3, 0], [3, 1], [0, 1]], dtype=torch.float64))
    heights = torch.arange(4, dtype=torch.float64)[:, None]
    measure = encode(square, normal_scale=1.0, features=square.vertices, face_features=heights, feature_scale=3.0)
    position, normal, vertex_part, face_part = places(measure).split([2, 2, 2, 1], dim=1)
    assert torch.allclose(vertex_part, 3 * position)
    outward = torch.tensor([[0.0, -1], [1, 0], [0, 1], [-1, 0]], dtype=torch.float64)
    assert torch.equal(normal, outward[(face_part[:, 0] / 3).long()])


def test_a_sample_has_normals_only_on_request():
    assert empirical(cube(), 7, 0).points.shape == (7, 3)
    assert empirical(cube(), 7, 0, normal_scale=1.0).points.shape == (7, 6)
    assert torch.equal(empirical(cube(), 7, 0, normal_scale=1.0).points[:, :3], empirical(cube(), 7, 0).points)


def test_a_cube_seen_by_its_normals():
    """On each of the six faces the normal is an axis, and the position along it half a side away."""
    points = empirical(cube(2.0), 500, 1, normal_scale=5.0).points
    assert torch.allclose((points[:, :3] * points[:, 3:]).sum(dim=1), torch.tensor(5.0, dtype=torch.float64))


@pytest.mark.parametrize("scale", ["normal_scale", "feature_scale"])
@pytest.mark.parametrize("value", [-1.0, math.nan, math.inf])
@every
def test_scales_are_lengths(encode, scale, value):
    with pytest.raises(ValueError, match=f"{scale} is {value}"):
        encode(cube(), **{scale: value})


@every
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"features": torch.ones(3, 1, dtype=torch.float64)}, r"features has shape \(3, 1\); \(8, k\)"),
        ({"face_features": torch.ones(8, 1, dtype=torch.float64)}, r"face_features has shape \(8, 1\); \(12, k\)"),
        ({"features": torch.ones(8, 1)}, "torch.float32 on cpu, vertices torch.float64"),
    ],
)
def test_features_fit(unchecked, encode, arguments, message):
    with pytest.raises(ValueError, match=message):
        encode(cube(), **arguments)


@every
def test_features_carry_gradients(encode):
    mesh = tetrahedron()
    linear, constant = (torch.ones(4, 1, dtype=torch.float64, requires_grad=True) for _ in range(2))
    places(encode(mesh, features=linear, face_features=constant)).sum().backward()
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


def test_polygons_keep_their_measure():
    """A cube of six squares and of twelve triangles, cut along the other diagonal too."""
    vertices = cube().vertices
    squares = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    turned = [square[1:] + square[:1] for square in squares]
    directions = torch.from_numpy(np.linalg.qr(np.random.default_rng(0).standard_normal((3, 3)))[0])
    for polygons in (squares, turned):
        assert float(sliced_wasserstein(surface(triangulate(vertices, polygons)), surface(cube()), directions)) < 1e-28


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
        (gradient,) = torch.autograd.grad((measure.weights**2).sum() + places(measure).sum(), vertices)
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
    assert not encode(shape, detach_weights=True).weights.requires_grad
    assert (VarifoldEncoding().normal_scale, VarifoldEncoding().detach_weights) == (0, False)


def test_encoding_arguments_are_keywords_in_one_order():
    wanted = ["normal_scale", "features", "face_features", "feature_scale", "detach_weights"]
    for encode in (surface, varifold, empirical, varifold_sample):
        parameters = inspect.signature(encode).parameters.values()
        assert [p.name for p in parameters if p.kind is p.KEYWORD_ONLY] == wanted


@every
def test_measures_move_to_another_type(unchecked, encode):
    measure = encode(cube())
    single = measure.to(torch.float32)
    assert type(single) is type(measure)
    assert single.places.dtype == single.weights.dtype == torch.float32
    assert torch.equal(single.places, measure.places.float())
    assert single.to("cpu", torch.float64).weights.dtype == torch.float64
    assert single.to(device="cpu").places.dtype == torch.float32
    with pytest.raises(ValueError, match=r"torch\.int64; floating point is needed"):
        measure.to(torch.int64)


def test_meshes_move_to_another_type(unchecked):
    assert cube().to("cpu", dtype=torch.float32).vertices.dtype == torch.float32
    with pytest.raises(ValueError, match=r"torch\.int64; floating point is needed"):
        cube().to(torch.int64)
