"""The arithmetic of live figures, in a browser, against the library, SciPy and POT on drawn problems."""

import math

import numpy as np
import ot
import pytest
import scipy.ndimage
import skimage.measure
import torch
from scipy import stats
from scipy.integrate import quad
from scipy.optimize import linear_sum_assignment
from scipy.special import ndtr
from skimage.measure import find_contours

import meshot
from meshot.flow import integrate
from meshot.loss import (
    energy_sliced_wasserstein,
    max_sliced_direction,
    quantile_cost,
    slice_costs,
    sliced_wasserstein,
)
from meshot.loss.directions import fibonacci_spiral
from meshot.loss.exact import exact_slice_costs, projected_law
from meshot.mesh import icosphere, topology
from meshot.view.page import joined
from meshot.volume import Volume, filled_cavities, genus_zero, isosurface, largest_component
from meshot.volume._kernel_surfaces import is_simple, stays_well_composed
from meshot_book.flows import descend
from meshot_book.statistics import people_needed, power_of_groups

MODULES = (
    "random",
    "transport",
    "crossings",
    "nearest",
    "assignment",
    "sinkhorn",
    "projection",
    "frames",
    "spheres",
    "distribution",
    "flow",
    "contours",
    "windows",
    "voxels",
    "normal",
    "power",
    "levels",
    "slices",
)
SCRIPT = joined(*(f"meshot_book/live/assets/{name}.js" for name in MODULES))
N_PROBLEMS = 200


@pytest.fixture(scope="module")
def found(context):
    """The value of a function of JavaScript for each case."""
    page = context.new_page()

    def values(function, cases):
        return page.evaluate(f"cases => {{ {SCRIPT}\nreturn cases.map({function}); }}", cases)

    yield values
    page.close()


def drawn_masses(generator, n):
    """Equal, unequal, or with zeros and ties among the sums."""
    kind = generator.integers(3)
    masses = np.ones(n) if kind == 0 else generator.uniform(0.1, 1, n) if kind == 1 else generator.integers(0, 4, n)
    masses = masses + (masses.sum() == 0)
    return masses / masses.sum()


def drawn_points(generator, n, d):
    """Rounded to a unit, a tenth or not at all: with ties and without."""
    digits = generator.choice([0, 1, 12])
    return generator.normal(size=(n, d), scale=2).round(digits)


def drawn_pairs(seed, d=None, most=25):
    """Sizes, dimensions, positions and masses of both sides."""
    generator = np.random.default_rng(seed)
    for _ in range(N_PROBLEMS):
        n, m, k = *generator.integers(1, most, size=2), d or generator.integers(1, 4)
        x, y = drawn_points(generator, n, k), drawn_points(generator, m, k)
        yield generator, x, drawn_masses(generator, n), y, drawn_masses(generator, m)


def close(ours, right):
    np.testing.assert_allclose(ours, right, rtol=1e-9, atol=1e-9)


def tensors(*arrays, of_first=True):
    made = [torch.tensor(array, dtype=torch.float64) for array in arrays]
    return [made[0].requires_grad_(of_first), *made[1:]]


def test_transport_on_a_line(found):
    cases, right, gradients, unique = [], [], [], []
    for generator, x, a, y, b in drawn_pairs(0, d=1):
        p = float(generator.choice([1, 1.5, 2, 3, 4]))
        x, y = x[:, 0], y[:, 0]
        cases.append([*(v.tolist() for v in (x, a, y, b)), p])
        places, others, masses, weights = tensors(x, y, a, b)
        value = quantile_cost(places[None], masses, others[None], weights, p).sum()
        value.backward()
        right.append([value.item(), float(ot.emd2_1d(x, y, a, b, metric="minkowski", p=p))])
        gradients.append(places.grad.numpy())
        unique.append(p > 1 and len(set(x)) == len(x))
    ours = found(
        """([x, a, y, b, p]) => {
          const plan = linePlan(x, a, y, b);
          const steps = quantiles(x, a);
          return {
            cost: planCost(plan, x, y, p), gradient: [...lineGradient(plan, x, y, p)], crossed: crossings(plan, x, y),
            order: [...orderOf(x)], sums: x.map((_, i) => plan.reduce((s, [k, , m]) => s + (k === i ? m : 0), 0)),
            mean: steps.reduce((s, [from, to, at]) => s + (to - from) * at, 0),
          };
        }""",
        cases,
    )
    for (x, a, *_), one, values, gradient, differentiable in zip(cases, ours, right, gradients, unique):
        close([one["cost"]] * 2, values)
        close(one["sums"], a)
        close(one["mean"], np.dot(x, a))
        assert one["order"] == np.argsort(x, kind="stable").tolist()
        assert one["crossed"] == 0
        if differentiable:
            close(one["gradient"], gradient)
    assert 50 < sum(unique) < N_PROBLEMS - 50
    assert sum(0 in case[1] for case in cases) > 20


def test_orders_of_numbers_that_differ_in_the_last_bits(found):
    base = np.nextafter(np.repeat(np.array([-3.0, 0.0, 1.0, 1e8]), 40), np.tile([-np.inf, np.inf], 80))
    cases = [np.random.default_rng(seed).permutation(base).tolist() for seed in range(20)]
    cases += [[0.0], [2.0, 2.0], (-np.ones(7)).tolist()]
    for case, order in zip(cases, found("values => [...orderOf(values)]", cases)):
        assert order == np.argsort(case, kind="stable").tolist()


def test_orders_from_an_order_that_is_nearly_right_or_all_wrong(found):
    generator, cases, right = np.random.default_rng(11), [], []
    for k in range(N_PROBLEMS):
        n = int(generator.integers(1, 120))
        values = generator.normal(size=n).round(int(generator.choice([1, 12])))
        right.append(np.argsort(values, kind="stable").tolist())
        near = np.argsort(values + 0.1 * generator.normal(size=n)) if k % 2 else np.array(right[-1][::-1])
        cases.append([values.tolist(), near.tolist()])
    ours = found(
        """([values, near]) => {
          const given = Int32Array.from(near);
          return [[...orderOf(values, given)], [...given]];
        }""",
        cases,
    )
    assert [order for order, _ in ours] == right
    assert [given for _, given in ours] == [near for _, near in cases]


def test_uncrossing_ends_at_the_sorted_cost(found):
    cases, right = [], []
    for generator, x, a, y, b in drawn_pairs(1, d=1, most=9):
        x, y = x[:, 0], y[:, 0]
        cases.append([*(v.tolist() for v in (x, a, y, b)), int(generator.integers(1000))])
        right.append(ot.emd2_1d(x, y, a, b, metric="sqeuclidean"))
    ours = found(
        """([x, a, y, b, seed]) => {
          const random = generator(seed);
          let plan = couple(shuffled(x.length, random), a, shuffled(y.length, random), b);
          const costs = [planCost(plan, x, y, 2)];
          for (let k = 0; k < 200 && crossings(plan, x, y) > 0; k += 1) {
            plan = uncrossed(plan, x, y);
            costs.push(planCost(plan, x, y, 2));
          }
          return { costs, left: crossings(plan, x, y) };
        }""",
        cases,
    )
    for one, value in zip(ours, right):
        assert one["left"] == 0
        assert (np.diff(one["costs"]) <= 1e-9).all()
        close(one["costs"][-1], value)
    assert max(len(one["costs"]) for one in ours) > 5


def test_chamfer(found):
    cases, right = [], []
    for _, x, a, y, b in drawn_pairs(2):
        cases.append([v.tolist() for v in (x, a, y, b)])
        places, others, masses, weights = tensors(x, y, a, b)
        value = meshot.chamfer(meshot.DiscreteMeasure(places, masses), meshot.DiscreteMeasure(others, weights))
        value.backward()
        right.append([value.item(), places.grad.numpy(), neighbours_are_unique(x, a, y, b)])
    ours = found("([x, a, y, b]) => chamferLoss(x, y, a, b)", cases)
    for one, (value, gradient, unique) in zip(ours, right):
        close(one["cost"], value)
        if unique:
            close(one["gradient"], gradient)
    assert 50 < sum(unique for *_, unique in right) < N_PROBLEMS - 20


def neighbours_are_unique(x, a, y, b):
    squared = ((x[a > 0][:, None] - y[b > 0]) ** 2).sum(axis=2)
    ties = [np.diff(np.sort(rows, axis=1)[:, :2], axis=1) < 1e-9 for rows in (squared, squared.T) if rows.shape[1] > 1]
    return not any(each.any() for each in ties)


def test_assignment(found):
    generator, cases, right = np.random.default_rng(3), [], []
    for _ in range(N_PROBLEMS):
        n, more = generator.integers(1, 30), generator.integers(0, 8)
        costs = generator.normal(size=(n, n + more)).round(generator.choice([0, 2, 12]))
        cases.append(costs.tolist())
        right.append(costs[linear_sum_assignment(costs)].sum())
    for case, one, value in zip(cases, found("costs => assignment(costs)", cases), right):
        columns = one["columns"]
        assert len(set(columns)) == len(case)
        close(one["cost"], value)
        close(sum(row[j] for row, j in zip(case, columns)), value)
    refused = found("() => { try { assignment([[1], [2]]); } catch (error) { return error.message; } }", [0])
    assert refused == ["2 rows for 1 columns: swap the two sides"]


def test_exact_transport_of_a_hundred_points(found):
    generator, cases, right = np.random.default_rng(4), [], []
    for k in range(N_PROBLEMS):
        n, d, p = 100 if k < 3 else generator.integers(1, 30), generator.integers(1, 4), float(generator.choice([1, 2]))
        x, y = drawn_points(generator, n, d), generator.normal(size=(n, d))
        cases.append([x.tolist(), y.tolist(), p])
        places, others = tensors(x, y)
        value = meshot.wasserstein(places, others, p=p)
        value.backward()
        right.append([value.item(), places.grad.numpy(), d > 1 or p > 1, len(np.unique(x, axis=0)) == n])
    for one, (value, gradient, single, apart) in zip(found("([x, y, p]) => exactLoss(x, y, p)", cases), right):
        close(one["cost"], value)
        if single and apart:
            close(one["gradient"], gradient)


def test_sinkhorn(found):
    cases, right = [], []
    for generator, x, a, y, b in drawn_pairs(5, most=9):
        # Costs many times larger than ε would need more iterations than POT takes.
        x, y = x / 4, y / 4
        p, blur = int(generator.integers(1, 3)), float(generator.uniform(0.5, 2))
        cases.append([*(v.tolist() for v in (x, a, y, b)), p, blur])
        right.append([entropic(x, a, y, b, p, blur), divergence(x, a, y, b, p, blur)])
    ours = found(
        """([x, a, y, b, p, blur]) => {
          const { cost, plan } = entropicTransport(groundCosts(x, y, p), a, b, p * blur ** p);
          return { cost, plan, divergence: sinkhornDivergence(x, a, y, b, { p, blur }) };
        }""",
        cases,
    )
    for one, ((cost, plan), value) in zip(ours, right):
        close(one["plan"], plan)
        close(one["cost"], cost)
        close(one["divergence"], value)


def test_sinkhorn_between_points_of_equal_mass(found):
    generator, cases, right, slopes = np.random.default_rng(12), [], [], []
    for _ in range(N_PROBLEMS):
        n, m, d = generator.integers(1, 9, size=3)
        x, y, way = (generator.normal(size=(k, d)) / 2 for k in (n, m, n))
        a, b, blur = np.full(n, 1 / n), np.full(m, 1 / m), float(generator.uniform(1, 2))
        cases.append([x.tolist(), y.tolist(), blur])
        right.append(divergence(x, a, y, b, 2, blur))
        ahead, back = (divergence(x + h * way, a, y, b, 2, blur) for h in (1e-4, -1e-4))
        slopes.append((way, (ahead - back) / 2e-4))
    ours = found(
        """([x, y, blur]) => {
          const whole = sinkhornLoss(x, y, { blur });
          const moved = y.map((point) => point.map((value) => value + 0.1));
          const starts = sinkhornLoss(x, moved, { blur, tolerance: 1e-3 }).potentials;
          return [whole, sinkhornLoss(x, y, { blur, starts })];
        }""",
        cases,
    )
    for (whole, started), value, (way, slope) in zip(ours, right, slopes):
        close([whole["cost"], started["cost"]], value)
        close(started["gradient"], whole["gradient"])
        # The differences of the reference have an error of h² and of rounding over h.
        assert np.sum(np.array(whole["gradient"]) * way) == pytest.approx(slope, rel=1e-5, abs=1e-6)


def entropic(x, a, y, b, p, blur):
    """Plan and cost of POT, which knows nothing of GeomLoss or of us."""
    costs = np.linalg.norm(x[:, None] - y, axis=2) ** p
    epsilon = p * blur**p
    kept, others = a > 0, b > 0
    plan = np.zeros_like(costs)
    inner = (a[kept], b[others], costs[np.ix_(kept, others)], epsilon)
    plan[np.ix_(kept, others)] = ot.sinkhorn(*inner, method="sinkhorn_log", stopThr=1e-12, numItermax=20000)
    product = np.outer(a, b)
    ratio = np.divide(plan, product, out=np.ones_like(plan), where=product > 0)
    return float((plan * costs).sum() + epsilon * (plan * np.log(ratio)).sum()), plan


def divergence(x, a, y, b, p, blur):
    sides = entropic(x, a, x, a, p, blur)[0] + entropic(y, b, y, b, p, blur)[0]
    return entropic(x, a, y, b, p, blur)[0] - sides / 2


def test_the_blur_is_that_of_the_library(found):
    generator, cases, right = np.random.default_rng(6), [], []
    for p in (1, 2):
        x, y = generator.normal(size=(6, 2)), generator.normal(size=(9, 2)) + 1
        cases.append([x.tolist(), [1 / 6] * 6, y.tolist(), [1 / 9] * 9, {"p": p, "blur": 1.5}])
        right.append(float(meshot.sinkhorn_divergence(x, y, p=p, blur=1.5, scaling=0.99)))
    ours = found("([x, a, y, b, options]) => sinkhornDivergence(x, a, y, b, options)", cases)
    np.testing.assert_allclose(ours, right, rtol=1e-3)


def test_sliced(found):
    cases, right = [], []
    for k, (generator, x, a, y, b) in enumerate(drawn_pairs(7)):
        if k % 2:  # equal masses, and every second time equal sizes
            y = drawn_points(generator, len(x), x.shape[1]) if k % 4 == 1 else y
            a, b = (np.full(len(side), 1 / len(side)) for side in (x, y))
        p = float(generator.choice([1, 1.5, 2, 3]))
        lines = generator.normal(size=(generator.integers(1, 9), x.shape[1]))
        lines /= np.linalg.norm(lines, axis=1, keepdims=True)
        options = {"p": p} if k % 2 else {"p": p, "a": a.tolist(), "b": b.tolist()}
        cases.append([x.tolist(), y.tolist(), lines.tolist(), options])
        places, others, masses, weights, directions = tensors(x, y, a, b, lines)
        sides = meshot.DiscreteMeasure(places, masses), meshot.DiscreteMeasure(others, weights)
        costs = slice_costs(*sides, directions, p=p)
        sliced_wasserstein(*sides, directions, p=p).backward()
        gaps = np.diff(np.sort(x @ lines.T, axis=0), axis=0)
        unique = p > 1 and not (gaps < 1e-9).any()
        right.append([costs.detach().numpy(), places.grad.numpy(), unique])
    for one, (costs, gradient, unique) in zip(found("args => slicedLoss(...args)", cases), right):
        close(one["costs"], costs)
        close(one["cost"], costs.mean())
        if unique:
            close(one["gradient"], gradient)
    assert sum(unique for *_, unique in right) > 50


def test_remembered_orders_change_no_value(found):
    """Frames in the plane: points move little or jump, lines stay or are drawn again, and sizes change between them."""
    generator, cases, right = np.random.default_rng(12), [], []
    for _ in range(N_PROBLEMS // 4):
        frames, n = [], int(generator.integers(2, 30))
        x, y = generator.normal(size=(n, 2)), generator.normal(size=(n, 2))
        turns = generator.uniform(0, np.pi, size=7)
        for _ in range(4):
            lines = np.stack([np.cos(turns), np.sin(turns)], axis=1)
            frames.append([x.tolist(), y.tolist(), lines.tolist()])
            places, others, directions = tensors(x, y, lines)
            sides = meshot.DiscreteMeasure(places), meshot.DiscreteMeasure(others)
            sliced_wasserstein(*sides, directions).backward()
            right.append([slice_costs(*sides, directions).detach().numpy(), places.grad.numpy()])
            kind = generator.integers(3)
            n = int(generator.integers(2, 30)) if kind == 0 else n
            x, y = (side + 0.05 * generator.normal(size=side.shape) for side in (x, y))
            x, y = (side if len(side) == n else generator.normal(size=(n, 2)) for side in (x, y))
            turns = generator.uniform(0, np.pi, size=generator.integers(1, 9)) if kind == 1 else turns
        cases.append(frames)
    remembering = """(frames) => {
      const memory = {};
      return frames.map((frame) => slicedLoss(...frame, { memory }));
    }"""
    for one, (costs, gradient) in zip([frame for frames in found(remembering, cases) for frame in frames], right):
        close(one["costs"], costs)
        close(one["gradient"], gradient)


def test_descents(found):
    generator, cases, right = np.random.default_rng(8), [], []
    for _ in range(N_PROBLEMS):
        n, m, d = generator.integers(2, 9), generator.integers(2, 9), int(generator.integers(2, 4))
        x, y, lines = generator.normal(size=(n, d)), generator.normal(size=(m, d)), generator.normal(size=(4, d))
        lines /= np.linalg.norm(lines, axis=1, keepdims=True)
        rate, momentum = float(generator.uniform(0.05, 0.5)), float(generator.choice([0, 0.5, 0.9]))
        cases.append([x.tolist(), y.tolist(), lines.tolist(), {"rate": rate, "momentum": momentum}])
        places, others, directions = tensors(x, y, lines, of_first=False)
        goal = meshot.DiscreteMeasure(others)
        loss = lambda points: sliced_wasserstein(meshot.DiscreteMeasure(points), goal, directions)  # noqa: E731, B023
        right.append(descend(loss, places, 12, rate, momentum).points.numpy())
    ours = found(
        """([x, y, lines, options]) => {
          let now = descent(x);
          for (let k = 0; k < 12; k += 1) {
            now = descend(now, slicedLoss(now.points, y, lines).gradient, options);
          }
          return now.points;
        }""",
        cases,
    )
    # Rounding may change the order of two points that meet, and with it the rest of a descent.
    agree = [np.allclose(one, points, rtol=1e-9, atol=1e-9) for one, points in zip(ours, right)]
    assert np.mean(agree) > 0.98


def mulberry(seed, n):
    """Mulberry32 in whole numbers of Python."""
    numbers, state, mask = [], seed & 0xFFFFFFFF, 0xFFFFFFFF
    for _ in range(n):
        state = (state + 0x6D2B79F5) & mask
        t = ((state ^ state >> 15) * (1 | state)) & mask
        t = ((t + (((t ^ t >> 7) * (61 | t)) & mask)) & mask) ^ t
        numbers.append((t ^ t >> 14) / 2**32)
    return numbers


def test_random_numbers(found):
    seeds = list(range(N_PROBLEMS))
    drawn = found("seed => { const random = generator(seed); return Array.from({ length: 20 }, random); }", seeds)
    assert drawn == [mulberry(seed, 20) for seed in seeds]
    normals = found(
        "s => { const random = generator(s); return Array.from({ length: 9 }, () => normal(random)); }", seeds
    )
    for seed, ours in zip(seeds, normals):
        u = np.array(mulberry(seed, 18)).reshape(9, 2)
        close(ours, np.sqrt(-2 * np.log1p(-u[:, 0])) * np.cos(2 * math.pi * u[:, 1]))
    orders = found("n => shuffled(n + 1, generator(n))", seeds)
    assert all(sorted(order) == list(range(len(order))) for order in orders)
    values = np.random.default_rng(0).normal(size=(N_PROBLEMS, 12))
    for row, one in zip(values, found("values => estimate(values)", values.tolist())):
        close([one["mean"], one["error"]], [row.mean(), row.std(ddof=1) / math.sqrt(12)])


def test_directions(found):
    kinds = ("random", "equally spaced", "orthogonal")
    cases = [[kind, count] for kind in kinds for count in range(1, 70)]
    ours = found("([kind, count]) => planeDirections(kind, count, generator(count))", cases)
    for (kind, count), rows in zip(cases, ours):
        lines = np.array(rows)
        assert lines.shape == (count, 2)
        close(np.linalg.norm(lines, axis=1), 1)
        if kind == "equally spaced":
            close(np.diff(np.unwrap(np.arctan2(lines[:, 1], lines[:, 0]))), np.full(count - 1, math.pi / count))
        if kind == "orthogonal":
            close((lines[0 : count - 1 : 2] * lines[1:count:2]).sum(axis=1), 0)
    spheres = found("d => sphereDirections(4000, d, generator(d))", [2, 3, 6])
    for d, rows in zip((2, 3, 6), spheres):
        lines = np.array(rows)
        close(np.linalg.norm(lines, axis=1), 1)
        # Each entry of the mean of θθᵀ has a standard deviation below 0.5 over the root of 4000.
        np.testing.assert_allclose(lines.T @ lines / 4000, np.eye(d) / d, atol=5 * 0.5 / math.sqrt(4000))


# Contours and meshes, projected without sampling.


def drawn_shapes():
    """Pairs of contours or meshes that share a direction: with perpendicular cells, equal values and slivers."""
    generator = np.random.default_rng(9)
    for k in range(N_PROBLEMS):
        d = int(generator.integers(2, 4))
        shapes = []
        for _ in range(2):
            n = int(generator.integers(d + 1, 12))
            vertices = drawn_points(generator, n, d) if k % 3 else generator.normal(size=(n, d))
            if k % 4 == 0:  # many cells perpendicular to the first axis
                vertices[:, 0] = np.sign(vertices[:, 0])
            cells = np.array([generator.choice(n, d, replace=False) for _ in range(int(generator.integers(1, 14)))])
            corners = vertices[cells]
            sides = corners[:, 1:] - corners[:, :1]
            shapes.append((vertices, cells[np.linalg.det(sides @ sides.transpose(0, 2, 1)) > 1e-6]))
        if all(len(cells) for _, cells in shapes):
            direction = np.eye(d)[0] if k % 4 == 0 else generator.normal(size=d)
            yield shapes, direction / np.linalg.norm(direction)


def measure_of(vertices, cells):
    kind = meshot.Mesh if cells.shape[1] == 3 else meshot.Contour
    return meshot.surface(kind(torch.tensor(vertices), torch.tensor(cells)))


def test_distributions_of_contours_and_triangles(found):
    cases, right, atoms = [], [], 0
    for shapes, direction in drawn_shapes():
        spans = np.sort(np.concatenate([vertices @ direction for vertices, _ in shapes]))
        at = np.concatenate([np.linspace(spans[0] - 1, spans[-1] + 1, 17), (spans[1:] + spans[:-1]) / 2])
        # Where F jumps, the last bit of a projection decides on which side a place is.
        at = at[np.abs(at[:, None] - spans).min(axis=1) > 1e-9]
        cases.append([*([v.tolist(), c.tolist()] for v, c in shapes), direction.tolist(), at.tolist()])
        measures, line = [measure_of(*shape) for shape in shapes], torch.tensor(direction)
        law = projected_law(measures[0], line)
        atoms += len(law.atoms[0])
        costs = [exact_slice_costs(*measures, line[None], p=p).item() for p in (1, 2)]
        right.append((law.distribution(at), law.density(at), costs))
    ours = found(
        """([[v, c], [w, e], direction, at]) => {
          const [one, other] = [projectedDistribution(v, c, direction), projectedDistribution(w, e, direction)];
          return {
            below: at.map((x) => massUpTo(one, x)), density: at.map((x) => density(one, x)),
            costs: [1, 2].map((p) => distributionCost(one, other, p)),
            back: [1, 2].map((p) => distributionCost(other, one, p)),
            same: [1, 2].map((p) => distributionCost(one, one, p)),
            sliced: exactSlicedLoss({ vertices: v, cells: c }, { vertices: w, cells: e }, [direction]).cost,
          };
        }""",
        cases,
    )
    for one, (below, dense, costs) in zip(ours, right):
        close(one["below"], below)
        close(one["density"], dense)
        close(one["costs"], costs)
        close(one["back"], costs)
        close(one["same"], [0, 0])
        close(one["sliced"], costs[1])
    assert len(cases) > 0.9 * N_PROBLEMS
    assert atoms > 20


def test_concentric_icospheres_approach_the_closed_form(found):
    errors = []
    for level in (1, 2):
        mesh = icosphere(level)
        vertices, cells = mesh.vertices.double().numpy(), mesh.faces.tolist()
        lines = np.random.default_rng(0).normal(size=(6, 3))
        lines /= np.linalg.norm(lines, axis=1, keepdims=True)
        one, other = ({"vertices": (r * vertices).tolist(), "cells": cells} for r in (1, 2))
        costs = found("args => exactSlicedLoss(...args).costs", [[one, other, lines.tolist(), 2]])[0]
        errors.append(np.abs(np.array(costs) - 1 / 3).max())
    # Pure O(h²): half the length of the edges, a quarter of the error.
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.15)


def test_flows(found):
    generator, cases, right = np.random.default_rng(10), [], []
    for k in range(N_PROBLEMS):
        d, n_steps = int(generator.integers(2, 4)), int(generator.integers(1, 9))
        method = ("euler", "midpoint", "rk4")[k % 3]
        bumps = [
            {"centre": generator.normal(size=d), "push": generator.normal(size=d), "reach": generator.uniform(0.5, 2)}
            for _ in range(generator.integers(1, 5))
        ]
        points, time = generator.normal(size=(5, d)), float(generator.choice([1, 0.3, 2, -1]))

        def field(_, x, bumps=bumps, time=time):
            pushes = (
                torch.exp(-(x - torch.tensor(b["centre"])).square().sum(1, keepdim=True) / (2 * b["reach"] ** 2))
                * torch.tensor(b["push"])
                for b in bumps
            )
            return time * sum(pushes)

        right.append(integrate(field, torch.tensor(points), n_steps, method).numpy())
        plain = [{key: np.asarray(value).tolist() for key, value in bump.items()} for bump in bumps]
        cases.append([plain, points.tolist(), {"steps": n_steps, "time": time, "method": method}])
    ours = found("([bumps, points, options]) => integrate(bumpField(bumps), points, options)", cases)
    for one, points in zip(ours, right):
        close(one, points)


def test_even_directions(found):
    counts = list(range(1, N_PROBLEMS + 1))
    angles = found("n => planeDirections('low-discrepancy', n, generator(n))", counts)
    spirals = found("n => spiralDirections(n, generator(n))", counts)
    golden = (math.sqrt(5) - 1) / 2
    for count, flat, rows in zip(counts, angles, spirals):
        turns = np.arctan2(*np.array(flat).T[::-1]) / math.pi
        close((np.diff(turns) - golden + 1e-6) % 1, np.full(count - 1, 1e-6))
        gaps = np.diff(np.sort(turns % 1), append=np.min(turns % 1) + 1)
        assert len(set(gaps.round(9))) <= 3  # the three-gap theorem
        # Up to a rotation it is the spiral of the library.
        lines, spiral = np.array(rows), fibonacci_spiral(count, 3, 0)
        close(lines @ lines.T, spiral @ spiral.T)
        close(np.linalg.det(lines[:3]), np.linalg.det(spiral[:3])) if count > 2 else None


def drawn_contour(generator, n):
    """Vertices around the origin, with edges of many lengths."""
    angles = np.sort(generator.uniform(0, 2 * math.pi, n))
    radii = generator.uniform(1, 3, n)
    return np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1)


def edges_of(vertices):
    ends = vertices.roll(-1, 0)
    lengths = (ends - vertices).norm(dim=1)
    return meshot.DiscreteMeasure((vertices + ends) / 2, lengths / lengths.sum())


def test_contours_descend_on_losses_in_places_and_masses(found):
    generator, cases, right = np.random.default_rng(21), [], []
    for k in range(N_PROBLEMS):
        x, y = (drawn_contour(generator, n) for n in generator.integers(3, 20, size=2))
        lines = generator.normal(size=(generator.integers(1, 7), 2))
        lines /= np.linalg.norm(lines, axis=1, keepdims=True)
        kind, width = ("Chamfer", "sliced Wasserstein")[k % 2], float(generator.choice([0, 0.5, 2]))
        vertices, other, directions = tensors(x, y, lines)
        goal = edges_of(other)
        moving = edges_of(vertices)
        value = meshot.chamfer(moving, goal) if k % 2 == 0 else sliced_wasserstein(moving, goal, directions)
        value.backward()
        masses = moving.weights.detach().numpy()
        arrows = -vertices.grad.numpy() / (masses + np.roll(masses, 1))[:, None]
        gaps = np.minimum(np.arange(len(x)), len(x) - np.arange(len(x)))
        kernel = np.exp(-(gaps**2) / (2 * width**2)) if width else np.eye(1, len(x))[0]
        kernel = kernel / kernel.sum()
        averaged = sum(weight * np.roll(arrows, -shift, axis=0) for shift, weight in enumerate(kernel))
        lengths = np.linalg.norm(np.roll(x, -1, 0) - x, axis=1)
        measured = [lengths.std() / lengths.mean(), mean_distance(x, y)]
        right.append([value.item(), vertices.grad.numpy(), averaged, measured])
        cases.append([kind, x.tolist(), y.tolist(), lines.tolist(), width])
    ours = found(
        """([kind, x, y, lines, width]) => {
          const { cost, gradient } = contourLoss(kind, x, edgesOf(y), lines);
          const arrows = descentDirections(x, gradient, width);
          return { cost, gradient, arrows, measured: [edgeVariation(x), contourDistance(x, y)] };
        }""",
        cases,
    )
    for one, (cost, gradient, arrows, measured) in zip(ours, right):
        close(one["cost"], cost)
        close(one["gradient"], gradient)
        close(one["arrows"], arrows)
        close(one["measured"], measured)


def mean_distance(one, other):
    """Of 160 points or more, as many on each edge, from the other polygon, both ways."""

    def away(vertices, others):
        per_edge = -(-160 // len(vertices))
        shares = ((np.arange(per_edge) + 0.5) / per_edge)[:, None]
        ends = np.roll(vertices, -1, 0)
        points = ((1 - shares) * vertices[:, None] + shares * ends[:, None]).reshape(-1, 2)
        sides = np.roll(others, -1, 0) - others
        along = ((points[:, None] - others) * sides).sum(axis=2) / (sides**2).sum(axis=1)
        feet = others + along.clip(0, 1)[:, :, None] * sides
        return np.linalg.norm(points[:, None] - feet, axis=2).min(axis=1).mean()

    return (away(one, other) + away(other, one)) / 2


def test_windows(found):
    cases, right, empty = [], [], 0
    for generator, x, a, y, b in drawn_pairs(22, d=2):
        centres, radius = generator.normal(size=(3, 2), scale=2), float(generator.uniform(0.5, 4))
        p = float(generator.choice([1, 2]))
        lines = generator.normal(size=(4, 2))
        lines /= np.linalg.norm(lines, axis=1, keepdims=True)
        places, others, masses, weights, at, directions = tensors(x, y, a, b, centres, lines)
        sides = meshot.DiscreteMeasure(places, masses), meshot.DiscreteMeasure(others, weights)
        in_all = directions[None].expand(3, -1, -1)
        try:
            value = meshot.windowed_sliced_wasserstein(*sides, at, radius, in_all, p)
        except ValueError:
            empty += 1
            continue
        value.backward()
        other = generator.normal(size=x.shape)
        cosine = weighted_cosine(places.grad.numpy(), other, a)
        gaps = np.diff(np.sort(x @ lines.T, axis=0), axis=0)
        unique = p > 1 and not (gaps < 1e-9).any()
        cases.append(
            [
                x.tolist(),
                a.tolist(),
                y.tolist(),
                b.tolist(),
                centres.tolist(),
                radius,
                lines.tolist(),
                p,
                other.tolist(),
            ]
        )
        right.append([value.item(), places.grad.numpy(), cosine, unique])
    ours = found(
        """([x, a, y, b, centres, radius, lines, p, other]) => {
          const sides = [{ points: x, masses: a }, { points: y, masses: b }];
          const { cost, gradient, counted } = windowedLoss(...sides, centres, radius, lines, p);
          return { cost, gradient, counted, cosine: fieldCosine(gradient, other, a) };
        }""",
        cases,
    )
    for one, (cost, gradient, cosine, unique) in zip(ours, right):
        close(one["cost"], cost)
        if unique:
            close(one["gradient"], gradient)
            close(one["cosine"], cosine)
    assert 0 < empty < N_PROBLEMS / 4
    assert sum(unique for *_, unique in right) > 40
    assert len({one["counted"] for one in ours}) == 3


def weighted_cosine(field, other, masses):
    one, two = (np.sqrt(masses)[:, None] * each for each in (field, other))
    return float((one * two).sum() / max(np.linalg.norm(one) * np.linalg.norm(two), 1e-300))


def test_orthogonal_blocks(found):
    generator = np.random.default_rng(13)
    cases = [[int(generator.integers(1, 40)), int(generator.integers(2, 7)), seed] for seed in range(N_PROBLEMS)]
    ours = found("([count, d, seed]) => orthogonalDirections(count, d, generator(seed))", cases)
    for (count, d, seed), rows in zip(cases, ours):
        n_blocks = -(-count // d)
        u = np.array(mulberry(seed, 2 * n_blocks * d * d)).reshape(n_blocks, d, d, 2)
        normals = np.sqrt(-2 * np.log1p(-u[..., 0])) * np.cos(2 * math.pi * u[..., 1])
        # Gram and Schmidt: the QR decomposition with a positive diagonal.
        q, r = np.linalg.qr(normals.transpose(0, 2, 1))
        q = q * np.sign(np.diagonal(r, axis1=1, axis2=2))[:, None, :]
        np.testing.assert_allclose(rows, q.transpose(0, 2, 1).reshape(-1, d)[:count], atol=1e-7)
        lines = np.array(rows)
        close(np.linalg.norm(lines, axis=1), 1)
        whole = lines[: count // d * d]
        close(whole.T @ whole, np.eye(d) * (count // d))


def drawn_mask(generator):
    """Noise at any density, often smoothed, so that there are solid parts, tunnels and cavities."""
    shape = tuple(int(n) for n in generator.integers(1, 9, size=3))
    values = generator.normal(size=shape)
    values = scipy.ndimage.gaussian_filter(values, generator.choice([0, 0.6, 1.2]))
    return values > np.quantile(values, generator.uniform(0, 0.9))


def test_topology_of_masks_and_balls_within_them(found):
    generator, cases, right = np.random.default_rng(12), [], []
    for _ in range(N_PROBLEMS):
        mask = drawn_mask(generator)
        mask.flat[generator.integers(mask.size)] = True
        priority = generator.normal(size=mask.shape).round(int(generator.choice([0, 12])))
        around = np.pad(mask, 1)
        counts = []
        for corners in (True, False):
            few, many = scipy.ndimage.generate_binary_structure(3, 1), np.ones((3, 3, 3))
            inside, outside = (many, few) if corners else (few, many)
            components = scipy.ndimage.label(around, inside)[1]
            cavities = scipy.ndimage.label(~around, outside)[1] - 1
            euler = skimage.measure.euler_number(around, connectivity=3 if corners else 1)
            counts += [components, cavities, components + cavities - euler]
        whole = filled_cavities(largest_component(mask))
        ball = genus_zero(whole, priority)
        assert topology(isosurface(Volume(np.pad(ball, 1).astype(float), np.eye(4)))).euler_number == 2
        right.append((counts, whole, ball))
        cases.append([list(mask.shape), mask.ravel().astype(int).tolist(), priority.ravel().tolist()])
    ours = found(
        """([shape, values, priority]) => {
          const grid = voxelGrid(shape);
          const mask = Uint8Array.from(onGrid(values, grid));
          const whole = wholePart(mask, grid);
          const ball = ballWithin(whole, onGrid(priority, grid), grid);
          const counts = [true, false].flatMap((corners) => {
            const { components, cavities, handles } = solidTopology(mask, grid, corners);
            return [components, cavities, handles];
          });
          const after = [true, false].map((corners) => solidTopology(ball, grid, corners));
          return [counts, [...whole], [...ball], after];
        }""",
        cases,
    )
    for (counts, whole, ball, after), (expected, *masks) in zip(ours, right):
        assert counts == expected
        for one, mask in zip((whole, ball), masks):
            assert (np.reshape(one, np.add(mask.shape, 2))[1:-1, 1:-1, 1:-1] == mask).all()
        assert after == 2 * [{"components": 1, "cavities": 0, "handles": 0}]
    handles, given_up = [counts[5] for counts, *_ in right], [(whole & ~ball).sum() for _, whole, ball in right]
    assert sum(number > 0 for number in handles) > 30
    assert sum(number > 0 for number in given_up) > 30
    assert sum(counts[1] > 0 for counts, *_ in right) > 10


# Studies of two groups.


def test_power_of_two_groups(found):
    generator = np.random.default_rng(11)
    sizes = np.r_[range(2, 30), generator.integers(2, 400, N_PROBLEMS - 28)].tolist()
    shifts = np.r_[0, 0, generator.uniform(-8, 8, N_PROBLEMS - 2)]  # beyond, SciPy has no value
    cases = list(zip((shifts / np.sqrt(np.array(sizes) / 2)).tolist(), sizes))
    close(found("([effect, n]) => powerOfGroups(effect, n)", cases), [power_of_groups(*case) for case in cases])
    values = generator.uniform(-9, 9, N_PROBLEMS).round(1).tolist()
    ours = found("value => normalBelow(value)", values)
    np.testing.assert_allclose(ours, stats.norm.cdf(values), rtol=1e-12)


def test_people_needed(found):
    generator = np.random.default_rng(12)
    cases = list(zip(np.exp(generator.uniform(-3, 1.5, N_PROBLEMS)), generator.choice([0.5, 0.8, 0.9], N_PROBLEMS)))
    ours = found("([effect, power]) => peopleNeeded(effect, power)", [[float(x) for x in case] for case in cases])
    assert ours == [people_needed(effect, power=power) for effect, power in cases]
    assert min(ours) < 4
    assert max(ours) > 2000


def test_intervals_of_a_variance(found):
    free = list(range(2, 2 * N_PROBLEMS + 2, 2))
    right = [(n / stats.chi2.ppf([0.975, 0.025], n)).tolist() for n in free]
    close(found("free => varianceFactors(free)", free), right)


def test_largest_of_normal_values(found):
    generator = np.random.default_rng(13)
    counts = list(range(1, N_PROBLEMS + 1))
    leads = generator.uniform(0, 5, N_PROBLEMS).tolist()
    right, chances = [], []

    def density(x):
        return math.exp(-x * x / 2) / math.sqrt(2 * math.pi)

    for n, lead in zip(counts, leads):
        largest = lambda x, n=n: x * n * density(x) * ndtr(x) ** (n - 1)  # noqa: E731
        below = lambda x, n=n, lead=lead: density(x) * ndtr(x + lead) ** (n - 1)  # noqa: E731
        right.append(quad(largest, -12, 12, epsabs=1e-13, limit=200)[0])
        chances.append(1 - quad(below, -12, 12, epsabs=1e-13, limit=200)[0])
    close(found("n => expectedLargest(n)", counts), right)
    close(found("([n, lead]) => leadByChance(n, lead)", list(zip(counts, leads))), chances)
    # Closed forms: two, and three values.
    close(found("n => expectedLargest(n)", [2, 3]), [1 / math.sqrt(math.pi), 1.5 / math.sqrt(math.pi)])


def test_level_curves(found):
    generator, fields = np.random.default_rng(11), []
    for _ in range(N_PROBLEMS):
        n, m = generator.integers(3, 12, size=2)
        field = np.ones((n, m))
        field[1:-1, 1:-1] = generator.normal(size=(n - 2, m - 2)) + generator.choice([-1, 0, 1])
        fields.append(field)
    cases = [{"values": field.ravel().tolist(), "n": field.shape[0], "m": field.shape[1]} for field in fields]
    several = 0
    for field, curves in zip(fields, found("({ values, n, m }) => levelCurves(values, n, m)", cases), strict=True):
        right = find_contours(field, 0, fully_connected="low")
        assert all((curve[0] == curve[-1]).all() for curve in right)
        several += len(right) > 1
        ours = sorted(sorted(map(tuple, curve)) for curve in curves)
        close(
            [point for curve in ours for point in curve],
            [point for curve in sorted(sorted(map(tuple, curve[:-1])) for curve in right) for point in curve],
        )
        assert sorted(map(len, ours)) == sorted(len(curve) - 1 for curve in right)
        # Neighbours along a curve are neighbours in ours.
        gaps = [np.linalg.norm(np.diff([*curve, curve[0]], axis=0), axis=1).max() for curve in map(np.array, curves)]
        assert max(gaps, default=0) <= np.sqrt(2)
    assert several > N_PROBLEMS / 4


def test_spheres(found):
    generator, cases, right = np.random.default_rng(14), [], []
    z, weights = np.polynomial.legendre.leggauss(40)
    for k in range(N_PROBLEMS):
        lines = generator.normal(size=(4, 3))
        lines /= np.linalg.norm(lines, axis=1, keepdims=True)
        radii, shift = generator.uniform(0.5, 3, size=2), generator.normal(size=3) * generator.choice([0, 1, 100])
        p = int(generator.integers(1, 5))
        if k % 5 == 0:
            radii[1] = radii[0]
        cases.append([lines.tolist(), radii.tolist(), shift.tolist(), p])
        # The quantile functions are linear: integrate on both sides of the position where they cross.
        a, c = radii[1] - radii[0], lines @ shift
        cut = np.clip(-c / a if a else np.zeros(4), -1, 1)
        halves = [(-np.ones(4), cut), (cut, np.ones(4))]
        parts = []
        for low, high in halves:
            places = (low + high) / 2 + np.outer(z, high - low) / 2
            parts.append((high - low) / 4 * (weights @ np.abs(a * places + c) ** p))
        right.append(sum(parts))
    for one, values in zip(found("([lines, radii, shift, p]) => sphereCosts(lines, radii, shift, p)", cases), right):
        np.testing.assert_allclose(one, values, rtol=1e-9, atol=1e-9)


# Slices that are chosen by their cost.


def test_energy_based_slices(found):
    generator, cases, right = np.random.default_rng(14), [], []
    for _ in range(N_PROBLEMS):
        d, power = int(generator.integers(2, 5)), float(generator.choice([0, 1, 1.5, 2, 8, 32]))
        x, y = (generator.normal(size=(int(generator.integers(2, 12)), d)) for _ in range(2))
        lines = generator.normal(size=(int(generator.integers(1, 9)), d))
        lines /= np.linalg.norm(lines, axis=1, keepdims=True)
        moving = torch.tensor(x, requires_grad=True)
        loss = energy_sliced_wasserstein(moving, torch.tensor(y), torch.tensor(lines), power=power)
        loss.backward()
        cases.append([x.tolist(), y.tolist(), lines.tolist(), power])
        right.append((float(loss.detach()), moving.grad.numpy()))
    for one, (loss, gradient) in zip(found("args => energySlicedLoss(...args)", cases), right):
        close(one["cost"], loss)
        close(one["gradient"], gradient)
        close(sum(one["weights"]), 1)


def test_the_ascent_to_the_slice_of_largest_cost(found):
    generator, cases, right = np.random.default_rng(15), [], []
    for k in range(N_PROBLEMS):
        d, n_steps = int(generator.integers(2, 5)), k % 9
        x, y = (generator.normal(size=(int(generator.integers(2, 12)), d)) for _ in range(2))
        start = generator.normal(size=d)
        start /= np.linalg.norm(start)
        cases.append([x.tolist(), y.tolist(), start.tolist(), n_steps])
        line = max_sliced_direction(x, y, torch.tensor(start)[None], n_steps=n_steps)
        right.append((line.numpy(), float(slice_costs(x, y, line[None].numpy())[0])))
    ours = found(
        """([x, y, start, steps]) => {
          let now = ascent(x, y, start);
          for (let k = 0; k < steps; k += 1) {
            now = climb(x, y, now);
          }
          return now;
        }""",
        cases,
    )
    for one, (line, cost) in zip(ours, right):
        close(one["line"], line)
        close(one["cost"], cost)


def test_which_voxels_can_be_added(found):
    generator, cases, right = np.random.default_rng(13), [], []
    while len(cases) < 10 * N_PROBLEMS:
        around = generator.random(27) < generator.uniform(0.1, 0.95)
        around[13] = False
        cases.append(around.astype(int).tolist())
        right.append([bool(is_simple(around)), bool(stays_well_composed(around))])
    assert found("around => [isSimple(around), staysWellComposed(around)]", cases) == right
    assert 100 < sum(both[0] for both in right) < len(cases) - 100
    assert 20 < sum(both[1] for both in right) < len(cases) - 100
