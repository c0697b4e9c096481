"""The exact sliced loss and its projected laws: closed forms, slow twins, degenerate faces, gradients, doors."""

import functools
import math

import numpy as np
import pytest
import torch

import oracles
import oracles_exact
import problems
from meshot import (
    DiscreteMeasure,
    Mesh,
    random_directions,
    sliced_wasserstein,
    surface,
    varifold,
)
from meshot.loss import _kernel_exact
from meshot.loss.exact import exact_sliced_wasserstein as exact_of_pairs, projected_law
from meshot.measure.continuous import SurfaceMeasure
from meshot.mesh.mesh import Contour, closed_contour
from meshot.mesh.shapes import cube, folded_sphere, icosphere, letter_e, split_in_four, tetrahedron
from refusals import refuses


def exact_sliced_wasserstein(source, target, directions, p=2):
    """The exact loss, also of two measures of points, for which the public function takes another way."""
    return exact_of_pairs([(source, target)], directions.to(source.places), p)[0]


both = pytest.mark.parametrize("p", [1, 2])


def soup(seed: int, n_vertices: int, n_cells: int, d: int, corners: int = 3, shift: float = 0.0) -> SurfaceMeasure:
    """Random cells on random vertices: crossing, sharing, leaving gaps."""
    generator = np.random.default_rng(seed)
    cells = np.stack([generator.choice(n_vertices, corners, replace=False) for _ in range(n_cells)])
    weights = generator.random(n_cells) + 0.1
    vertices = torch.from_numpy(generator.standard_normal((n_vertices, d))) + shift
    return SurfaceMeasure(vertices, torch.from_numpy(cells), torch.from_numpy(weights / weights.sum()))


def moved(mesh: Mesh, shift: torch.Tensor) -> Mesh:
    return mesh.with_vertices(mesh.vertices + shift)


def block(seed: int, d: int = 3) -> torch.Tensor:
    """Orthogonal directions: the mean of ⟨t, θ⟩² over them is |t|²/d."""
    return torch.from_numpy(np.linalg.qr(np.random.default_rng(seed).standard_normal((d, d)))[0])


def awkward(generator: np.random.Generator, d: int) -> SurfaceMeasure:
    """A few cells on vertices that may tie exactly or nearly, or lie close together; masses of many sizes."""
    corners, n_cells = int(generator.integers(2, 4)), int(generator.integers(1, 9))
    n_vertices = int(generator.integers(corners, 9))
    grid = generator.integers(0, 4, (n_vertices, d)).astype(float)
    free, small = generator.standard_normal((2, n_vertices, d))
    tenth = 10.0 ** -generator.integers(3, 16)
    vertices = [grid, grid + tenth * small, free, tenth * free][generator.integers(4)]
    weights = (generator.random(n_cells) + 1e-3) ** generator.choice([1, 6])
    cells = np.stack([generator.choice(n_vertices, corners, replace=False) for _ in range(n_cells)])
    return SurfaceMeasure(*(torch.from_numpy(a) for a in (vertices, cells, weights / weights.sum())))


@pytest.mark.parametrize("seed", range(60))
def test_awkward_cells(seed):
    """The slow twin's value, and gradients that add up as those of a translation and of a dilation must."""
    generator = np.random.default_rng(seed)
    d = int(generator.integers(1, 4))
    pair = [awkward(generator, d), awkward(generator, d)]
    directions = torch.cat([random_directions(1, d, generator), torch.eye(d, dtype=torch.float64)[:1]])
    for p in (1, 2):
        vertices = [m.vertices.clone().requires_grad_() for m in pair]
        ends = [SurfaceMeasure(v, m.cells, m.weights) for v, m in zip(vertices, pair, strict=True)]
        cost = exact_sliced_wasserstein(*ends, directions, p)
        cost.backward()
        expected = oracles_exact.sliced_cost(*pair, directions, p)
        scale = max(float(m.vertices.abs().max()) for m in pair)
        assert float(cost.detach()) == pytest.approx(expected, abs=1e-12 * scale**p)
        growth = sum(float((v.grad * v.detach()).sum()) for v in vertices)
        assert growth == pytest.approx(p * expected, abs=1e-11 * scale**p)
        assert float(sum(v.grad.sum(dim=0) for v in vertices).abs().max()) < 1e-11 * scale ** (p - 1)


@both
@pytest.mark.parametrize("seed", [35, 49, 143, 185, 237])
def test_a_density_that_falls_to_almost_nothing(seed, p):
    """Two corners 1e-8 apart at the end of a law leave 1e-16 of the mass behind them, where digits may cancel."""
    x = torch.tensor([-0.55, 0.4, -0.2, -0.08, 0.4 - 1e-8, -0.54], dtype=torch.float64)[:, None]
    cells = torch.tensor([[2, 3, 5], [4, 3, 0], [5, 4, 0], [5, 3, 4], [2, 1, 3], [0, 2, 5]])
    weights = np.random.default_rng(seed).random(6) + 0.1
    target, one = SurfaceMeasure(x, cells, torch.from_numpy(weights / weights.sum())), torch.ones(1, 1).double()
    near = torch.tensor([[-7e-9], [-4e-10], [1.1e-8]], dtype=torch.float64)
    source = SurfaceMeasure(near, torch.tensor([[0, 1, 2]]), one[0])
    expected = oracles_exact.sliced_cost(source, target, one, p)
    assert float(exact_sliced_wasserstein(source, target, one, p)) == pytest.approx(expected, rel=1e-13, abs=0)


@both
def test_spheres_reach_their_closed_form_at_second_order(p):
    """A projected sphere is uniform on an interval: W_p^p = |r − s|^p / (p + 1)."""
    exact, directions = 0.5**p / (p + 1), random_directions(6, 3, 0)
    pairs = [(surface(icosphere(s)), surface(icosphere(s, 1.5))) for s in (1, 2, 3, 4)]
    errors = [exact - float(exact_sliced_wasserstein(*pair, directions, p)) for pair in pairs]
    ratios = np.array(errors[:-1]) / errors[1:]
    assert errors[-1] < 3e-4
    assert np.allclose(ratios[1:], 4, atol=0.1)


@pytest.mark.parametrize("size", [1.0, 1e-3])
def test_translation(size):
    """To roundoff in the shift: relative to a small one it is larger by as much."""
    shift = size * torch.tensor([0.3, -0.2, 0.5], dtype=torch.float64)
    sphere, directions = folded_sphere(3, 1.0, 0.2), block(0)
    pair = surface(sphere), surface(moved(sphere, shift))
    exactly = functools.partial(pytest.approx, rel=3e-14 / size, abs=0)
    assert float(exact_sliced_wasserstein(*pair, directions)) == exactly(float(shift.square().sum()) / 3)
    for theta in directions:
        for p in (1, 2):
            found = exact_sliced_wasserstein(*pair, theta[None], p)
            assert float(found) == exactly(abs(float(shift @ theta)) ** p)


def test_translation_of_twenty_thousand_faces():
    """Roundoff of one scan must not outlive the triangles that made it."""
    shift, sphere = torch.tensor([0.3, -0.2, 0.5], dtype=torch.float64), folded_sphere(5, 1.0, 0.2)
    value = exact_sliced_wasserstein(surface(sphere), surface(moved(sphere, shift)), block(0))
    # The mass of a line is a sum over 10 242 breakpoints, each rounded: its standard deviation is √10 242 ε = 2e-14,
    # whatever the order in which a processor adds. Four of them.
    error = 4 * len(sphere.vertices) ** 0.5 * torch.finfo(torch.float64).eps
    assert float(value) == pytest.approx(float(shift.square().sum()) / 3, rel=error, abs=0)


@both
def test_distance_to_itself_is_zero(p):
    sphere, directions = folded_sphere(3, 1.0, 0.2), random_directions(6, 3, 0)
    assert float(exact_sliced_wasserstein(surface(sphere), surface(sphere), directions, p)) == 0
    generator = np.random.default_rng(0)
    names = torch.from_numpy(generator.permutation(len(sphere.vertices)))
    faces = torch.argsort(names)[sphere.faces][torch.from_numpy(generator.permutation(len(sphere.faces)))]
    renamed = surface(Mesh(sphere.vertices[names], faces))
    assert float(exact_sliced_wasserstein(surface(sphere), renamed, directions, p)) < 1e-14**p


@both
@pytest.mark.parametrize("n_cuts", [0, 3])
@pytest.mark.parametrize("tilt", [0.0, 1e-300, 1e-16, 1e-12, 1e-8])
def test_faces_seen_edge_on(tilt, n_cuts, p):
    """Along an axis a cube of side s is two atoms of 1/6 and a uniform law; sides 1 and 2 differ by |x|.

    A tilt of ε changes places by less than ε, and the cost by its square: the whole is a dilation by two.
    """
    vertices, faces = cube().vertices, cube().faces
    for _ in range(n_cuts):
        vertices, faces = split_in_four(vertices, faces)
    source, target = surface(Mesh(vertices, faces)), surface(cube(2.0))
    exact = (1 / 3) * 0.5**p + (2 / 3) * 0.5**p / (p + 1)
    theta = torch.tensor([[1.0, tilt, 0.0]], dtype=torch.float64)
    assert float(exact_sliced_wasserstein(source, target, theta, p)) == pytest.approx(exact, abs=1e-13)


def test_faces_seen_edge_on_up_to_roundoff():
    rotation = block(3)
    pair = [surface(mesh.with_vertices(mesh.vertices @ rotation.T)) for mesh in (cube(), cube(2.0))]
    value = exact_sliced_wasserstein(*pair, rotation.T.contiguous())
    assert float(value) == pytest.approx(1 / 12 + 1 / 18, abs=1e-13)


@both
def test_points_as_atoms(p):
    source, target = problems.cloud(0, 30, 3, weighted=True), problems.cloud(1, 21, 3, weighted=True)
    directions = random_directions(10, 3, 0)
    expected = oracles.sliced_wasserstein(source, target, directions.numpy(), p)
    assert float(exact_sliced_wasserstein(source, target, directions, p)) == pytest.approx(expected, rel=1e-12, abs=0)


@both
def test_points_against_a_surface(p):
    """A point is a triangle whose corners coincide."""
    points, mesh = varifold(icosphere(0), normal_scale=0.5), surface(tetrahedron(), normal_scale=0.5)
    directions = random_directions(5, 6, 0)
    corners = torch.arange(3 * len(points.points)).view(-1, 3)
    collapsed = SurfaceMeasure(points.points.repeat_interleave(3, dim=0), corners, points.weights)
    expected = oracles_exact.sliced_cost(collapsed, mesh, directions, p)
    for measure in (points, collapsed):
        found = float(exact_sliced_wasserstein(measure, mesh, directions, p))
        assert found == pytest.approx(expected, rel=1e-12, abs=0)


def encoded_pairs(seed: int):
    """Encodings as functions of vertices, with the vertices at which to differentiate."""
    generator = np.random.default_rng(seed)
    first, second = tetrahedron(torch.from_numpy(generator.standard_normal((4, 3)))), icosphere(0)
    second = moved(second, 0.1 * torch.from_numpy(generator.standard_normal((12, 3))))
    line, loop = (closed_contour(torch.from_numpy(generator.standard_normal((n, 2)))) for n in (5, 7))
    lifted, points = (functools.partial(encode, normal_scale=0.7) for encode in (surface, varifold))
    return {
        "surfaces": (first, surface, second, surface, 3),
        "surfaces with normals": (first, lifted, second, lifted, 6),
        "surface and points": (first, lifted, second, points, 6),
        "contours": (line, surface, loop, surface, 2),
    }


@both
@pytest.mark.parametrize("name", encoded_pairs(0))
def test_gradients(name, p):
    first, encode, second, encode_other, d = encoded_pairs(0)[name]
    directions = random_directions(4, d, 0)

    def loss(v, w):
        pair = encode(first.with_vertices(v)), encode_other(second.with_vertices(w))
        return exact_sliced_wasserstein(*pair, directions, p)

    vertices = [shape.vertices.clone().requires_grad_() for shape in (first, second)]
    assert torch.autograd.gradcheck(loss, vertices, eps=1e-6, atol=1e-8, rtol=1e-6)


@both
def test_gradient_in_the_weights_needs_no_normalisation(p):
    """The loss divides by the total mass itself, so that its gradient is the potential of mean zero."""
    source, target, directions = soup(1, 9, 14, 3), problems.cloud(0, 8, 3, weighted=True), random_directions(4, 3, 0)
    weights = [m.weights.clone().requires_grad_() for m in (source, target)]
    pair = SurfaceMeasure(source.vertices, source.cells, weights[0]), type(target)(target.points, weights[1])
    exact_sliced_wasserstein(*pair, directions, p).backward()
    assert all(abs(float(w.grad @ w.detach())) < 1e-13 for w in weights)

    def loss(a, b):
        pair = SurfaceMeasure(source.vertices, source.cells, a / a.sum()), type(target)(target.points, b / b.sum())
        return exact_sliced_wasserstein(*pair, directions, p)

    assert torch.autograd.gradcheck(loss, weights, eps=1e-6, atol=1e-8, rtol=1e-6)


@both
@pytest.mark.parametrize("tilt", [0.0, 1e-15, 1e-12, 1e-8])
def test_gradient_of_moving_and_growing_edge_on(tilt, p):
    """Sums that are known whatever the tilt: a cube against itself moved along the line, and against its double."""
    theta = torch.tensor([1.0, tilt, 0.0], dtype=torch.float64)
    vertices = cube().vertices.clone().requires_grad_()
    source = surface(cube().with_vertices(vertices), detach_weights=True)
    loss = exact_sliced_wasserstein(source, surface(moved(cube(), 0.3 * theta)), theta[None], p)
    (gradient,) = torch.autograd.grad(loss, vertices)
    assert float(gradient.sum(dim=0) @ theta) == pytest.approx({1: -1, 2: -0.6}[p], rel=1e-12, abs=0)
    loss = exact_sliced_wasserstein(source, surface(cube(2.0)), theta[None], p)
    (gradient,) = torch.autograd.grad(loss, vertices)
    exact = -p * ((1 / 3) * 0.5**p + (2 / 3) * 0.5**p / (p + 1))
    assert float((gradient * cube().vertices).sum()) == pytest.approx(exact, rel=1e-12, abs=0)


def test_no_gradient_where_both_laws_agree():
    """p = 1 has a kink where F = G: an identical far piece has no gradient, though roundoff separates the two."""
    near, far = soup(1, 6, 5, 3), soup(2, 6, 5, 3, shift=20.0)
    cells, weights = torch.cat([near.cells, far.cells + 6]), torch.cat([near.weights, far.weights]) / 2
    vertices = torch.cat([near.vertices, far.vertices]).requires_grad_()
    other = torch.cat([near.vertices + 1, far.vertices]).detach()
    theta = torch.full((1, 3), math.sqrt(1 / 3), dtype=torch.float64)
    pair = SurfaceMeasure(vertices, cells, weights), SurfaceMeasure(other.flip(0), 11 - cells, weights)
    exact_sliced_wasserstein(*pair, theta, 1).backward()
    assert float(vertices.grad[6:].abs().max()) < 1e-15
    assert float(vertices.grad[:6].abs().min()) > 1e-3


@pytest.fixture
def threads():
    before = torch.get_num_threads()
    yield torch.set_num_threads
    torch.set_num_threads(before)


def test_threads_share_the_directions(threads):
    target, directions, found = surface(icosphere(2, 1.3)), random_directions(7, 3, 0), []
    for n_threads in (1, 2, 2):
        threads(n_threads)
        vertices = folded_sphere(2, 1.0, 0.2).vertices.requires_grad_()
        value = exact_sliced_wasserstein(surface(icosphere(2).with_vertices(vertices)), target, directions)
        value.backward()
        found.append((value.detach(), vertices.grad))
    (one, gradient), (two, gradient_two), (again, gradient_again) = found
    assert torch.equal(two, again)
    assert torch.equal(gradient_two, gradient_again)
    assert torch.allclose(one, two, rtol=1e-14)
    assert torch.allclose(gradient, gradient_two, rtol=1e-12, atol=1e-16)


def test_single_precision_in_and_out():
    sphere, directions = icosphere(2, dtype=torch.float32), random_directions(6, 3, 0, dtype=torch.float32)
    vertices = sphere.vertices.clone().requires_grad_()
    target = surface(icosphere(2, 1.5, dtype=torch.float32))
    value = exact_sliced_wasserstein(surface(sphere.with_vertices(vertices)), target, directions)
    value.backward()
    assert value.dtype == vertices.grad.dtype == torch.float32
    double = exact_sliced_wasserstein(surface(icosphere(2)), surface(icosphere(2, 1.5)), directions.double())
    assert float(value.detach()) == pytest.approx(float(double), rel=1e-5)


def test_doors():
    sphere, eye = surface(icosphere(0)), torch.eye(3, dtype=torch.float64)
    refuses(r"p is 3; .* p = 1 and 2", sliced_wasserstein, sphere, sphere, eye, 3)
    refuses("same space", sliced_wasserstein, sphere, surface(icosphere(0), normal_scale=1.0), eye)
    refuses("unit rows", sliced_wasserstein, sphere, sphere, 2 * eye)
    with pytest.raises(ValueError, match=r"pass directions.detach\(\)"):
        sliced_wasserstein(sphere, sphere, eye.requires_grad_())


def test_the_sliced_loss_takes_continuous_measures():
    sphere, points, directions = surface(icosphere(1)), problems.cloud(0, 9, 3), random_directions(4, 3, 0)
    for pair in ((sphere, sphere), (sphere, points), (points, sphere)):
        assert torch.equal(sliced_wasserstein(*pair, directions, 1), exact_sliced_wasserstein(*pair, directions, 1))
    refuses(r"p is 1.5; .* p = 1 and 2", sliced_wasserstein, points, sphere, directions, 1.5)


CORNERS = torch.tensor([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0]], dtype=torch.float64)
#: Two coincident corners, three corners on a line, three coincident corners.
COLLAPSED = {
    "two corners": CORNERS,
    "a line": torch.cat([CORNERS[:3], torch.tensor([[0.5, 0, 0]], dtype=torch.float64)]),
    "a point": torch.cat([CORNERS, CORNERS[:1]]),
}
FACES = {"two corners": [[0, 1, 2], [0, 3, 1]], "a line": [[0, 1, 2], [0, 3, 1]], "a point": [[0, 1, 2], [0, 3, 4]]}


def directions() -> torch.Tensor:
    """Random ones and the axes, to which edges of the triangle are perpendicular."""
    return torch.cat([random_directions(6, 3, 0), torch.eye(3, dtype=torch.float64)])


@both
@pytest.mark.parametrize("name", COLLAPSED)
def test_a_collapsed_face_weighs_nothing(name, p):
    """The value, and the gradient of the vertices that are not its own, are those without the face."""
    values, gradients = [], []
    target = surface(cube(1.3))
    for faces in (FACES[name], FACES[name][:1]):
        vertices = COLLAPSED[name].clone().requires_grad_()
        values.append(sliced_wasserstein(surface(Mesh(vertices, torch.tensor(faces))), target, directions(), p))
        values[-1].backward()
        gradients.append(vertices.grad[:3])
    twin = surface(Mesh(COLLAPSED[name], torch.tensor(FACES[name][:1])))
    expected = oracles_exact.sliced_cost(twin, target, directions(), p)
    assert float(values[0].detach()) == pytest.approx(expected, rel=1e-12, abs=0)
    # Both sum the same few numbers; a face without mass adds breakpoints, at which cells are cut.
    torch.testing.assert_close(gradients[0], gradients[1], rtol=1e-9, atol=1e-12)


def test_a_face_of_weight_zero_edge_on():
    """Perpendicular edges without a collapse: the weight is given, and the edge x = 0 has no extent along x."""
    measure = SurfaceMeasure(CORNERS[:3], torch.tensor([[0, 1, 2], [1, 2, 0]]), torch.tensor([1.0, 0]).double())
    alone = SurfaceMeasure(CORNERS[:3], torch.tensor([[0, 1, 2]]), torch.ones(1).double())
    assert float(exact_sliced_wasserstein(measure, alone, torch.eye(3).double())) == 0


@pytest.mark.parametrize("side", [0, 1])
def test_a_law_without_numbers_is_refused_and_not_walked_for_ever(side):
    law = (np.array([0.0, 1, 1]), np.array([1.0, 0, 0]), np.array([1.0, 0, np.inf]), np.zeros(3))
    broken = (law[0], law[1], np.array([np.nan, np.nan, np.inf]), law[3])
    pair = (broken, law) if side == 0 else (law, broken)
    with pytest.raises(ValueError, match="did not reach their ends"):
        _kernel_exact.walk(2, *pair, (False, False), np.zeros((3, 3)), np.zeros((3, 3)))


@pytest.mark.parametrize("mass", [np.nan, np.inf, 0.0])
def test_masses_that_are_no_numbers_are_refused(mass):
    law = tuple(np.empty(5) for _ in range(4))
    with pytest.raises(ValueError, match="NaN, infinite or zero"):
        _kernel_exact.lay_points(np.array([0.0, 1]), np.array([0, 1]), np.array([mass, mass]), *law)


@both
@pytest.mark.parametrize("scale", [1e-150, 1e-120, 1e-12, 1e12, 1e90, 1e150])
def test_the_scale_does_not_matter(p, scale):
    """The coordinates are scaled by a power of two, so that only their own rounding under ``scale`` is left."""

    def measure(mesh: Mesh, factor: float) -> SurfaceMeasure:
        shares = surface(mesh).weights
        return SurfaceMeasure((mesh.vertices * factor).requires_grad_(), mesh.faces, shares)

    found = []
    for factor in (1.0, scale):
        pair = measure(icosphere(1), factor), measure(cube(1.3), factor)
        value = exact_sliced_wasserstein(*pair, random_directions(4, 3, 0), p)
        value.backward()
        found.append((float(value.detach()) / factor**p, pair[0].vertices.grad / factor ** (p - 1)))
    assert found[1][0] == pytest.approx(found[0][0], rel=1e-12)
    torch.testing.assert_close(found[1][1], found[0][1], rtol=1e-9, atol=1e-12)


def test_a_cost_beyond_float64_is_refused():
    vertices = torch.eye(3, dtype=torch.float64) * 1e160
    measure = SurfaceMeasure(vertices, torch.tensor([[0, 1, 2]]), torch.ones(1).double())
    refuses("exceeds float64", exact_sliced_wasserstein, measure, measure, torch.eye(3).double())


X, Y = (torch.eye(3, dtype=torch.float64)[k] for k in (0, 1))


def triangle(*corners: tuple[float, float, float]) -> Mesh:
    return Mesh(torch.tensor(corners, dtype=torch.float64), torch.tensor([[0, 1, 2]]))


def test_a_triangle_is_a_tent():
    """Corners at 0, 1 and 4: the peak 2/(4 − 0) at the middle one."""
    law = projected_law(surface(triangle((1, 5, 0), (4, 0, 1), (0, 0, 0))), X)
    x = np.array([-1.0, 0, 0.5, 1, 2.5, 4, 5])
    assert np.allclose(law.density(x), [0, 0, 0.25, 0.5, 0.25, 0, 0])
    assert np.allclose(law.distribution(x), [0, 0, 1 / 16, 0.25, 1 - 0.25 * 1.5 / 2, 1, 1])
    assert len(law.atoms[0]) == 0


def test_two_corners_at_one_end_make_a_slope():
    law = projected_law(surface(triangle((0, 0, 0), (0, 3, 0), (2, 1, 0))), X)
    assert np.allclose(law.density(np.array([1e-9, 1.0, 2.0])), [1, 0.5, 0], atol=1e-8)


def test_a_cube_along_its_axis_is_two_atoms_and_a_box():
    law = projected_law(surface(cube(2.0)), X)
    places, masses = law.atoms
    assert np.allclose(places, [-1, 1])
    assert np.allclose(masses, [1 / 6, 1 / 6])
    assert np.allclose(law.density(np.array([-0.99, 0.1, 0.99])), 1 / 3)
    assert np.allclose(law.distribution(np.array([-1.1, -1, 0, 0.999999999999, 1])), [0, 1 / 6, 0.5, 5 / 6, 1])


def test_a_face_seen_edge_on_is_an_atom():
    law = projected_law(surface(triangle((1, 0, 0), (1, 1, 0), (1, 0, 3))), X)
    assert law.atoms[0].tolist() == [1.0]
    assert law.atoms[1].tolist() == [1.0]
    assert law.distribution(np.array([0.9, 1.0])).tolist() == [0.0, 1.0]
    assert law.density(np.array([1.0])).tolist() == [0.0]


def test_an_edge_is_a_box():
    law = projected_law(surface(Contour(torch.tensor([[0.0, 0], [3, 4]]).double(), torch.tensor([[0, 1]]))), X[:2])
    assert np.allclose(law.density(np.array([-0.1, 0.1, 2.9, 3.1])), [0, 1 / 3, 1 / 3, 0])


@pytest.mark.parametrize(
    "measure",
    [
        surface(tetrahedron()),
        surface(folded_sphere(2, 1.0, 0.3)),
        surface(letter_e()),
        surface(icosphere(1), normal_scale=0.7),
    ],
    ids=repr,
)
def test_the_slow_twin_agrees(measure):
    d = measure.vertices.shape[1]
    for theta in [*random_directions(3, d, 0), torch.eye(d, dtype=torch.float64)[0]]:
        law = projected_law(measure, theta)
        places = (measure.vertices @ theta).numpy()
        x = np.linspace(places.min() - 0.1, places.max() + 0.1, 301)
        expected = oracles_exact.share_below(places, measure.cells.numpy(), measure.weights.numpy(), x)
        assert np.allclose(law.distribution(x), expected, rtol=0, atol=1e-13)
        assert law.masses.sum() == pytest.approx(1, abs=1e-14)


def test_points_are_atoms():
    points = torch.tensor([[0.0], [2.0], [2.0], [5.0]], dtype=torch.float64)
    weights = torch.tensor([0.1, 0.2, 0.3, 0.4], dtype=torch.float64)
    law = projected_law(DiscreteMeasure(points, weights), torch.ones(1, dtype=torch.float64))
    assert np.allclose(law.atoms, [[0, 2, 5], [0.1, 0.5, 0.4]])
    assert np.allclose(law.distribution(np.array([-1.0, 0, 1, 2, 4.9, 5])), [0, 0.1, 0.1, 0.6, 0.6, 1])
    assert not law.density(np.array([0.0, 1, 2])).any()


def test_doors_of_projection(unchecked):
    refuses("unit rows", projected_law, surface(cube()), 2 * X)
    with pytest.raises(ValueError, match="3"):
        projected_law(varifold(cube(), normal_scale=1.0), X)
