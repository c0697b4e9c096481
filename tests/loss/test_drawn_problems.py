"""Every loss and every measure on many drawn problems each, against a slow twin or a closed form."""

import math

import hypothesis.strategies as st
import numpy as np
import pytest
import torch
from drawn_pairs import EXPONENTS, SEEDS, drawn, in_double, line_cost, pairs, soups
from scipy.optimize import linear_sum_assignment

from meshot import (
    DiscreteMeasure,
    Mesh,
    SurfaceMeasure,
    chamfer,
    empirical,
    random_directions,
    sinkhorn_divergence,
    slice_costs,
    sliced_wasserstein,
    surface,
    varifold,
    wasserstein,
    windowed_sliced_wasserstein,
)
from meshot.loss.sliced import plain_sliced_wasserstein

#: Checks of annotations cost ten times what such small problems do; other tests have them.
pytestmark = pytest.mark.usefixtures("unchecked")


def sliced_twin(source, target, directions, p):
    """The mean over directions of transport on a line, in double precision."""
    (x, a), (y, b) = source, target
    return float(np.mean([line_cost(x @ theta, y @ theta, a, b, p) for theta in directions]))


def close(value, expected, pair, p, times=1.0):
    assert value.dtype == pair.source.points.dtype
    assert abs(float(value) - expected) <= times * pair.rounding(p)


def lines_for(pair, seed, n=2):
    return random_directions(n, pair.source.points.shape[1], seed, pair.source.points.dtype)


@pytest.mark.parametrize("loss", [sliced_wasserstein, plain_sliced_wasserstein])
@drawn(pairs(), EXPONENTS, SEEDS)
def test_sliced(loss, pair, p, seed):
    directions = lines_for(pair, seed)
    expected = sliced_twin(*map(in_double, pair.both), directions.double().numpy(), p)
    close(loss(*pair.both, directions, p), expected, pair, p)


@drawn(pairs())
def test_chamfer(pair):
    (x, a), (y, b) = map(in_double, pair.both)
    squared = ((x[:, None] - y[None]) ** 2).sum(axis=2)
    expected = float(a @ squared[:, b > 0].min(axis=1) + b @ squared[a > 0].min(axis=0))
    close(chamfer(*pair.both), expected, pair, 2, times=2)


@drawn(pairs(equal=True), EXPONENTS)
def test_wasserstein_is_an_assignment_between_equal_masses(pair, p):
    (x, _), (y, _) = map(in_double, pair.both)
    unit = max(pair.size, math.ulp(0.0))
    costs = (((x[:, None] - y[None]) / unit) ** 2).sum(axis=2) ** (p / 2)
    expected = float(costs[linear_sum_assignment(costs)].mean()) * unit**p
    close(wasserstein(*pair.both, p), expected, pair, p)


@drawn(pairs(dimensions=st.just(1)), EXPONENTS)
def test_wasserstein_on_a_line(pair, p):
    (x, a), (y, b) = map(in_double, pair.both)
    close(wasserstein(*pair.both, p), line_cost(x[:, 0], y[:, 0], a, b, p), pair, p)


@drawn(pairs(dimensions=st.integers(1, 4)))
def test_sinkhorn_does_not_know_order_or_handedness(pair):
    """Swapped, in another order, mirrored: the same. Zero between equal measures."""
    unit = max(pair.size, 1e-30)
    first, second = (DiscreteMeasure(m.points / unit, m.weights) for m in pair.both)
    value = float(sinkhorn_divergence(first, second, blur=0.5, scaling=0.2))
    mirrored = (DiscreteMeasure(-m.points.flip(0), m.weights.flip(0)) for m in (second, first))
    # Five iterations, each a sum of exponentials of dual potentials that are bounded by 4/ε = 4/.5².
    tolerance = 5 * 16 * (len(first.points) + len(second.points)) * torch.finfo(first.points.dtype).eps
    assert abs(float(sinkhorn_divergence(*mirrored, blur=0.5, scaling=0.2)) - value) <= tolerance
    assert abs(float(sinkhorn_divergence(first, first, blur=0.5, scaling=0.2))) <= tolerance


@drawn(pairs(dimensions=st.integers(2, 6)), EXPONENTS, SEEDS)
def test_windowed(pair, p, seed):
    random, dtype = np.random.default_rng(seed), pair.source.points.dtype
    (x, a), (y, b) = map(in_double, pair.both)
    radius, k = float(pair.size * random.uniform(0.3, 2)), int(random.integers(1, x.shape[1] + 1))
    if not 1e-150 < radius < 1e150:  # squares of the radius are no numbers there
        return
    centres = torch.from_numpy(np.array([x[0, :k], y[0, :k]])).to(dtype)
    sets = torch.stack([lines_for(pair, seed % 2**20 + i) for i in range(2)])
    expected = []
    for centre, directions in zip(centres.double().numpy(), sets.double().numpy(), strict=True):
        far = [((places[:, :k] - centre) ** 2).sum(axis=1) / radius**2 for places in (x, y)]
        if any(np.any(np.abs(f - 2.5**2) < 1e-4) for f in far):
            return  # on the rim: rounding decides
        inside = [w * np.exp(-f / 2) * (f < 2.5**2) for w, f in zip((a, b), far)]
        if min(i.sum() for i in inside) > 1e-30:
            shares = (i / i.sum() for i in inside)
            expected.append(sliced_twin((x, next(shares)), (y, next(shares)), directions, p))
    if expected:
        value = windowed_sliced_wasserstein(*pair.both, centres, radius, sets, p)
        # The share of a point is off by the rounding of its exponent, at most 3.2, and of its place.
        close(value, float(np.mean(expected)), pair, p, times=8)


@drawn(soups(), st.sampled_from([1, 2]), SEEDS)
def test_a_surface_moved_costs_its_way(soup, p, seed):
    """Moved by t, a surface is |⟨t, θ⟩| away along every direction."""
    measure, size = soup
    random = np.random.default_rng(seed)
    shift = torch.from_numpy(size * random.standard_normal(3))
    other = SurfaceMeasure(measure.vertices + shift, measure.cells, measure.weights)
    directions = random_directions(2, 3, seed % 2**20)
    expected = (directions @ shift).abs() ** p
    found = slice_costs(measure, other, directions, p)
    reach = 2 * size * math.sqrt(3) + float(shift.norm())
    # Quantiles are roots of quadratics in the mass: off by √ε·R, but only where the density is least, on masses of √ε.
    # Elsewhere ε·R for each of at most 3 pieces a face.
    tolerance = 64 * 3 * len(measure.cells) * torch.finfo(torch.float64).eps * reach**p
    assert float((found - expected).abs().max()) <= tolerance


@drawn(pairs())
def test_a_measure_has_the_points_that_it_was_given_and_mass_one(pair):
    for measure in pair.both:
        n, epsilon = len(measure.points), torch.finfo(measure.points.dtype).eps
        assert abs(float(measure.weights.double().sum()) - 1) <= n * epsilon
        assert float(measure.weights.min()) >= 0
        twice = measure.to(torch.float64)
        assert torch.equal(twice.points, measure.points.double())
        assert torch.equal(DiscreteMeasure(measure.points, measure.weights).points, measure.points)


@st.composite
def meshes(draw):
    """A few triangles, thin ones among them, at any scale; none of them collapsed, and a strided array of vertices."""
    random = np.random.default_rng(draw(SEEDS))
    n, scale = int(random.integers(1, 7)), 10.0 ** int(random.choice([0, 0, -6, 6, -60, 60]))
    places = random.standard_normal((n + 2, 3)) * np.array([1, 1, random.choice([1.0, 1e-6])])
    faces = np.array([random.permutation(n + 2)[:3] for _ in range(n)])
    vertices = np.asfortranarray(places * scale) if random.random() < 0.5 else places * scale
    return Mesh(torch.from_numpy(vertices), torch.from_numpy(faces)), scale


def faces_by_hand(mesh):
    """Barycentres, unit normals and shares of the area, face by face."""
    corners = mesh.vertices.numpy()[mesh.faces.numpy()]
    unit = np.abs(corners).max()
    crosses = np.cross(*((corners[:, k] - corners[:, 0]) / unit for k in (1, 2)))
    lengths = np.linalg.norm(crosses, axis=1)
    return corners.mean(axis=1), crosses / lengths[:, None], lengths / lengths.sum()


@drawn(meshes(), st.floats(0.1, 10))
def test_varifold(drawn_mesh, scale):
    mesh, size = drawn_mesh
    measure = varifold(mesh, normal_scale=scale * size)
    centres, normals, shares = faces_by_hand(mesh)
    # Edges are differences: off by ε·R. A cross product of a thin face, of edge 1 and height h, is off by ε/h.
    heights = shares.min() / 10
    np.testing.assert_allclose(measure.points[:, :3].numpy(), centres, rtol=0, atol=4e-15 * size)
    np.testing.assert_allclose(measure.points[:, 3:].numpy() / (scale * size), normals, rtol=0, atol=1e-14 / heights)
    np.testing.assert_allclose(measure.weights.numpy(), shares, rtol=0, atol=1e-14 / heights)


@drawn(meshes(), st.integers(1, 9), SEEDS)
def test_empirical(drawn_mesh, n_points, seed):
    """As many points as asked for, of equal mass, each in the plane of a face and within the box of all."""
    mesh, size = drawn_mesh
    measure = empirical(mesh, n_points, seed % 2**31, normal_scale=size)
    assert measure.points.shape == (n_points, 6)
    np.testing.assert_allclose(measure.weights.detach().numpy(), 1 / n_points, rtol=1e-14)
    points, normals = measure.points[:, :3].numpy(), measure.points[:, 3:].numpy() / size
    low, high = mesh.vertices.numpy().min(axis=0), mesh.vertices.numpy().max(axis=0)
    assert np.all((points >= low - 1e-14 * size) & (points <= high + 1e-14 * size))
    firsts = mesh.vertices.numpy()[mesh.faces.numpy()[:, 0]]
    offsets = np.abs(((points[:, None] - firsts[None]) * normals[:, None]).sum(axis=2)).min(axis=1)
    assert offsets.max() <= 1e-13 * size / faces_by_hand(mesh)[2].min()


@drawn(meshes())
def test_surface(drawn_mesh):
    mesh, _ = drawn_mesh
    measure = surface(mesh)
    assert torch.equal(measure.vertices, mesh.vertices)
    shares = faces_by_hand(mesh)[2]
    np.testing.assert_allclose(measure.weights.numpy(), shares, rtol=0, atol=1e-13 / shares.min())
