"""The sliced loss: the fused kernel against its plain twin, the cost along every direction, and POT."""

import numpy as np
import ot
import pytest
import torch

import problems
from meshot import slice_costs, surface
from meshot.loss._kernel_sliced import SMALL, sort, sort_scratch
from meshot.loss.directions import random_directions
from meshot.loss.sliced import plain_sliced_wasserstein, sliced_wasserstein
from meshot.measure.discrete import DiscreteMeasure
from meshot.mesh.shapes import icosphere
from refusals import refuses


def weighted(rng, n, zeros=0):
    weights = rng.random(n) + 0.05
    weights[:zeros] = 0
    return weights / weights.sum()


def case(name, rng):
    """Points and weights of both sides."""
    n, m, d = {"one by one": (1, 1, 2), "one by n": (1, 9, 3), "n by one": (9, 1, 3)}.get(name, (40, 60, 6))
    x, y, a, b = rng.normal(size=(n, d)), rng.normal(size=(m, d)), weighted(rng, n), weighted(rng, m)
    if name == "zero weights":
        a, b = weighted(rng, n, 15), weighted(rng, m, 59)
    if name == "equal masses":
        y, a, b = y[:n], np.full(n, 1 / n), np.full(n, 1 / n)
    if name == "ties":
        x, y = rng.integers(0, 2, (n, d)).astype(float), rng.integers(0, 2, (m, d)).astype(float)
    if name == "identical":
        y, b = x.copy(), a.copy()
    if name == "uneven totals":  # within what a measure may err; the excess goes to the last step of the other side
        a, y, b = a * (1 + 9e-9), y[:5], b[:5] / b[:5].sum()
    if name == "far outlier":
        x[3] = 1e4
    return x, a, y, b


CASES = (
    "generic",
    "one by one",
    "one by n",
    "n by one",
    "zero weights",
    "equal masses",
    "identical",
    "far outlier",
    "uneven totals",
)


def both(arrays, p, directions=7):
    """Value and gradients of kernel and twin; those in the weights, known up to a constant, from the first."""
    found = []
    for loss in (sliced_wasserstein, plain_sliced_wasserstein):
        x, a, y, b = (torch.from_numpy(array).requires_grad_() for array in arrays)
        lines = random_directions(directions, x.shape[1], 0)
        value = loss(DiscreteMeasure(x, a), DiscreteMeasure(y, b), lines, p)
        to_x, to_a, to_y, to_b = torch.autograd.grad(value, (x, a, y, b))
        found.append((value, to_x, to_a - to_a[0], to_y, to_b - to_b[0]))
    return zip(*found)


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("p", [1, 1.5, 2, 3])
def test_kernel_agrees_with_its_twin(name, p):
    arrays = case(name, np.random.default_rng(0))
    for found, expected in both(arrays, p):
        scale = max(1.0, float(expected.detach().abs().max()))
        torch.testing.assert_close(found, expected, rtol=1e-9, atol=1e-10 * scale)


@pytest.mark.parametrize("p", [1, 2])
def test_ties(p):
    # Points at one place are interchangeable: only the sum of their gradients is determined.
    arrays = case("ties", np.random.default_rng(0))
    value, to_x, _, to_y, _ = both(arrays, p)
    torch.testing.assert_close(*value)
    for array, gradients in ((arrays[0], to_x), (arrays[2], to_y)):
        place = torch.from_numpy(np.unique(array, axis=0, return_inverse=True)[1].ravel())
        torch.testing.assert_close(*(torch.zeros(64, 6).double().index_add(0, place, each) for each in gradients))


@pytest.mark.parametrize("name", CASES)
def test_potentials_are_dual(name):
    x, a, y, b = (torch.from_numpy(array).requires_grad_() for array in case(name, np.random.default_rng(0)))
    value = sliced_wasserstein(DiscreteMeasure(x, a), DiscreteMeasure(y, b), random_directions(7, x.shape[1], 0), 1.5)
    to_a, to_b = torch.autograd.grad(value, (a, b))
    torch.testing.assert_close((a * to_a).sum() + (b * to_b).sum(), value)


def test_gradcheck():
    x, a, y, b = (torch.from_numpy(array).requires_grad_() for array in case("generic", np.random.default_rng(1)))
    lines = random_directions(3, 6, 0)

    def loss(x, a, y, b):
        return sliced_wasserstein(DiscreteMeasure(x, a / a.sum()), DiscreteMeasure(y, b / b.sum()), lines)

    assert torch.autograd.gradcheck(loss, (x[:6], a[:6], y[:5], b[:5]))


def test_only_the_gradients_that_are_wanted():
    x, a, y, b = (torch.from_numpy(array) for array in case("generic", np.random.default_rng(1)))
    lines = random_directions(3, 6, 0)
    value = sliced_wasserstein(DiscreteMeasure(x.requires_grad_(), a), DiscreteMeasure(y, b), lines)
    (gradient,) = torch.autograd.grad(3 * value, x)
    (once,) = torch.autograd.grad(plain_sliced_wasserstein(DiscreteMeasure(x, a), DiscreteMeasure(y, b), lines), x)
    torch.testing.assert_close(gradient, 3 * once)
    with torch.no_grad():
        assert float(sliced_wasserstein(DiscreteMeasure(x, a), DiscreteMeasure(y, b), lines)) == float(value.detach())


@pytest.mark.parametrize("sizes", [(SMALL + 900, 500), (300, SMALL + 1), (SMALL + 50, SMALL + 7)])
@pytest.mark.parametrize("d", [2, 6])
def test_large_measures_are_laid_out_otherwise_and_give_the_same(sizes, d):
    """Beyond ``SMALL`` points are kept along a curve, values dealt into ranges, and projections lie elsewhere."""
    rng = np.random.default_rng(d)
    n, m = sizes
    arrays = rng.normal(size=(n, d)), weighted(rng, n), rng.normal(size=(m, d)) + 0.2, weighted(rng, m)
    for found, expected in both(arrays, 2, directions=2):
        torch.testing.assert_close(found, expected, rtol=1e-8, atol=1e-13)
    x, a, y, b = (torch.from_numpy(array) for array in arrays)
    lines = random_directions(2, d, 0)
    for wanted in ((x,), (b,), (a, y)):
        for tensor in (x, a, y, b):
            tensor.requires_grad_(any(tensor is w for w in wanted))
        one, twin = (
            torch.autograd.grad(loss(DiscreteMeasure(x, a), DiscreteMeasure(y, b), lines), wanted)
            for loss in (sliced_wasserstein, plain_sliced_wasserstein)
        )
        for found, expected, tensor in zip(one, twin, wanted):
            shift = (expected - found).mean() if tensor.dim() == 1 else 0
            torch.testing.assert_close(found + shift, expected, rtol=1e-8, atol=1e-12)


SORTED = {
    "gaussian": lambda rng: rng.normal(size=5000),
    "ties": lambda rng: rng.integers(0, 9, 500).astype(float),
    "constant": lambda rng: np.full(20, 3.5),
    "single": lambda rng: np.array([1.0]),
    "outlier": lambda rng: np.append(rng.normal(size=3000), 1e12),
    "subnormal range": lambda rng: rng.integers(0, 9, 50) * 5e-324,
    "widest range": lambda rng: np.append(rng.normal(size=50), [-1.7e308, 1.7e308]),
    "overflow": lambda rng: np.array([1.0, np.inf, -np.inf, 0.0, np.inf]),
    "not a number": lambda rng: np.append(rng.normal(size=50), np.nan),
    "descending": lambda rng: np.arange(3000.0)[::-1].copy(),
    "many": lambda rng: rng.normal(size=SMALL + 5000),
    "many ties": lambda rng: rng.integers(0, 300, SMALL + 1000).astype(float),
    "many, one far away": lambda rng: np.append(rng.normal(size=SMALL + 10), 1e9),
    "many, all the same": lambda rng: np.full(SMALL + 1, 2.5),
    "many, not all numbers": lambda rng: np.append(rng.normal(size=SMALL + 10), [np.inf, np.nan]),
}


@pytest.mark.parametrize("name", SORTED)
def test_sort_is_numpys_stable_sort(name):
    values = SORTED[name](np.random.default_rng(0))
    n = len(values)
    ascending, order = np.empty(n), np.empty(n, np.uint32)
    sort(values, ascending, order, sort_scratch(n))
    np.testing.assert_array_equal(order, np.argsort(values, kind="stable"))
    np.testing.assert_array_equal(ascending, np.sort(values))


LINES = random_directions(9, 3, 0)


def measures(kind):
    solid = icosphere(1)
    continuous = surface(solid), surface(solid.with_vertices(1.3 * solid.vertices + 0.2))
    points = problems.cloud(0, 30, 3, True), problems.cloud(1, 21, 3, True)
    equal = problems.cloud(0, 30, 3), problems.cloud(1, 30, 3)
    return {
        "discrete": points,
        "equal masses": equal,
        "continuous": continuous,
        "mixed": (continuous[0], points[1]),
        "mixed, turned round": (points[0], continuous[1]),
    }[kind]


@pytest.mark.parametrize("p", [1, 2])
@pytest.mark.parametrize("kind", ["discrete", "equal masses", "continuous", "mixed", "mixed, turned round"])
def test_their_mean_is_the_loss(kind, p):
    source, target = measures(kind)
    costs = slice_costs(source, target, LINES, p)
    assert costs.shape == (9,)
    assert costs.dtype == torch.float64
    assert not costs.requires_grad
    assert float(costs.mean()) == pytest.approx(float(sliced_wasserstein(source, target, LINES, p)), rel=1e-13)
    one_by_one = [float(sliced_wasserstein(source, target, line[None], p)) for line in LINES]
    assert costs.tolist() == pytest.approx(one_by_one, rel=1e-13)


@pytest.mark.parametrize("kind", ["discrete", "equal masses"])
def test_a_gradient_that_is_wanted_is_that_of_the_plain_path(kind):
    source, target = measures(kind)
    points = source.points.clone().requires_grad_()
    moved = DiscreteMeasure(points, source.weights)
    upstream = torch.from_numpy(np.random.default_rng(0).normal(size=9))
    costs = slice_costs(moved, target, LINES)
    (found,) = torch.autograd.grad(costs @ upstream, points)
    losses = torch.stack([plain_sliced_wasserstein(moved, target, line[None]) for line in LINES])
    (expected,) = torch.autograd.grad(losses @ upstream, points)
    torch.testing.assert_close(found, expected, rtol=1e-10, atol=1e-14)
    torch.testing.assert_close(costs.detach(), slice_costs(source, target, LINES), rtol=1e-12, atol=0)
    with torch.no_grad():
        assert not slice_costs(moved, target, LINES).requires_grad


def test_with_a_continuous_measure_they_are_values():
    solid = icosphere(1)
    moving = surface(solid.with_vertices(solid.vertices.clone().requires_grad_()))
    assert not slice_costs(moving, measures("discrete")[1], LINES).requires_grad


def test_single_precision_and_doors(unchecked):
    source, target = (DiscreteMeasure(m.points.float(), m.weights.float()) for m in measures("discrete"))
    assert slice_costs(source, target, LINES).dtype == torch.float32
    refuses(r"p is 0.5", slice_costs, source, target, LINES, 0.5)
    with pytest.raises(ValueError, match="p is 3"):
        slice_costs(measures("continuous")[0], measures("discrete")[1], LINES, 3)
    refuses("unit rows", slice_costs, source, target, 2 * LINES)
    refuses("same space", slice_costs, source, problems.cloud(0, 3, 2, dtype=torch.float32), LINES)


both_of_pot_properties = pytest.mark.parametrize("loss", [sliced_wasserstein, plain_sliced_wasserstein])


def pot_distance(source, target, directions, p):
    """POT's sliced distance over the same directions (columns there), to the power p."""
    arrays = [m.points.numpy() for m in (source, target)] + [m.weights.numpy() for m in (source, target)]
    return ot.sliced_wasserstein_distance(*arrays, projections=directions.numpy().T, p=p) ** p


@both_of_pot_properties
@pytest.mark.parametrize(("m", "weighted"), [(100, False), (200, False), (200, True)])
@pytest.mark.parametrize("p", [1, 2, 3])
def test_the_value_of_pot(loss, p, m, weighted):
    source, target = problems.cloud(0, 100, 4, weighted), problems.cloud(1, m, 4, weighted)
    directions = random_directions(20, 4, 0)
    value = loss(source, target, directions, p)
    assert float(value) == pytest.approx(pot_distance(source, target, directions, p), rel=1e-10)
    assert float(value) > 0


@both_of_pot_properties
@pytest.mark.parametrize("p", [1, 2, 3])
@pytest.mark.parametrize("weighted", [True, False])
def test_gradients_of_pot(loss, p, weighted):
    """Where POT differentiates by torch, ours agrees, in points of equal and of unequal masses."""
    directions, found = random_directions(15, 3, 0), []
    clouds = problems.cloud(0, 30, 3, weighted), problems.cloud(1, 30, 3, weighted)

    def by_pot(source, target):
        points = source.points, target.points, source.weights, target.weights
        return ot.sliced_wasserstein_distance(*points, projections=directions.T.contiguous(), p=p) ** p

    for compute in (lambda *pair: loss(*pair, directions, p), by_pot):
        points = [m.points.clone().requires_grad_() for m in clouds]
        value = compute(*(DiscreteMeasure(x, m.weights) for x, m in zip(points, clouds, strict=True)))
        found.append(torch.autograd.grad(value, points))
    for ours, theirs in zip(*found, strict=True):
        assert bool(torch.isfinite(ours).all())
        torch.testing.assert_close(ours, theirs, rtol=1e-9, atol=1e-12)


@both_of_pot_properties
def test_gradients_are_finite_where_measures_agree(loss):
    points = problems.cloud(0, 20, 3).points.requires_grad_()
    for p in (1, 1.5, 2, 3):
        value = loss(DiscreteMeasure(points), DiscreteMeasure(points.detach().clone()), random_directions(9, 3, 0), p)
        (gradient,) = torch.autograd.grad(value, points)
        assert float(gradient.abs().max()) == 0
