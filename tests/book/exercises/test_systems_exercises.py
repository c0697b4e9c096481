"""The exercises of chapter 34: truths by counting, by loops and by SciPy, and a hint for each usual mistake."""

import numpy as np
import pytest
from scipy.spatial import KDTree

from meshot_book.exercises import check


def by_counting(thickness, spacing):
    """The share of many positions of the grid at which no layer is in the slab [0, thickness)."""
    shifts = (np.arange(400_000) + 0.5) / 400_000 * spacing
    return float(np.mean(shifts >= thickness))


def by_trees(points, truths, curvatures, most):
    weights = np.minimum(1 + curvatures.numpy(), most)
    gaps, nearest = KDTree(truths.numpy()).query(points.numpy())
    back, _ = KDTree(points.numpy()).query(truths.numpy())
    return (weights[nearest] * gaps**2).mean() + (weights * back**2).mean()


def by_table(fields, points, n_steps):
    """RK4 from its Butcher tableau."""
    nodes, shares = (0, 0.5, 0.5, 1), (1 / 6, 1 / 3, 1 / 3, 1 / 6)
    for field in fields:
        for _ in range(n_steps):
            slopes = []
            for node in nodes:
                slopes.append(field(points + node / n_steps * slopes[-1] if slopes else points))
            points = points + sum(share * slope for share, slope in zip(shares, slopes)) / n_steps
    return points


@pytest.mark.parametrize(("checker", "function"), [(check.curved_chamfer, by_trees), (check.through_chain, by_table)])
def test_independent_solutions_pass(capsys, checker, function):
    checker(function)
    assert capsys.readouterr().out.startswith("✓")


@pytest.mark.parametrize(("thickness", "spacing"), [(0.5, 1.0), (1.2, 1.5), (1.0, 1.0), (3.0, 1.0)])
def test_the_chance_is_a_share_of_positions(thickness, spacing):
    assert max(0.0, 1 - thickness / spacing) == pytest.approx(by_counting(thickness, spacing), abs=1e-5)


def test_the_formula_passes(capsys):
    check.chance_missed(lambda t, h: max(0.0, 1 - t / h))
    assert capsys.readouterr().out.startswith("✓")


def loops(points, truths, curvatures, most, weigh=True, power=2, mean=True):
    weights = [min(1 + float(k), most) for k in curvatures]
    first = second = 0.0
    for x in points:
        gaps = [float((x - y).norm()) for y in truths]
        j = gaps.index(min(gaps))
        first += (weights[j] if weigh else 1) * gaps[j] ** power
    for w, y in zip(weights, truths):
        second += w * min(float((x - y).norm()) for x in points) ** power
    return first / len(points) + second / len(truths) if mean else first + second


def euler(fields, points, n_steps):
    for field in fields:
        for _ in range(n_steps):
            points = points + field(points) / n_steps
    return points


@pytest.mark.parametrize(
    ("checker", "function", "hint"),
    [
        (check.chance_missed, lambda t, h: min(t / h, 1), "the other is asked"),
        (check.chance_missed, lambda t, h: 1 - t / h, "no chance"),
        (check.chance_missed, lambda t, h: 1.0 * (t < h), "by some positions"),
        (check.chance_missed, lambda t, h: max(0, 1 - 2 * t / h), "not on both sides"),
        (check.chance_missed, lambda t, h: max(0, 1 - t / h / 2), "after one spacing"),
        (check.chance_missed, lambda t, h: max(0, 1 - h / t), "exchanged"),
        (check.chance_missed, lambda t, h: max(0, 1 - t / h) ** 3, "only one axis"),
        (check.curved_chamfer, lambda x, y, k, m: loops(x, y, 0 * k, m), "changes nothing"),
        (check.curved_chamfer, lambda x, y, k, m: loops(x, y, k, np.inf), "may not exceed"),
        (check.curved_chamfer, lambda x, y, k, m: loops(x, y, k.clamp(max=m) - 1, np.inf), "not zero"),
        (check.curved_chamfer, lambda *a: loops(*a, power=1), "squared"),
        (check.curved_chamfer, lambda *a: loops(*a, weigh=False), "first direction have a weight"),
        (check.curved_chamfer, lambda *a: loops(*a, mean=False), "a mean over its points"),
        (check.curved_chamfer, lambda *a: by_trees(*a) - one_sided(*a), "of the true points are missing"),
        (check.curved_chamfer, lambda *a: one_sided(*a), "of the found points are missing"),
        (check.through_chain, lambda f, x, n: by_table([lambda p: sum(g(p) for g in f)], x, n), "sum of the fields"),
        (check.through_chain, lambda f, x, n: by_table(f[::-1], x, n), "reverse order"),
        (check.through_chain, euler, "Euler's method"),
        (check.through_chain, lambda f, x, n: by_table(f, x, 1), "only one step"),
        (check.through_chain, lambda f, x, n: by_table(f[:1], x, n), "only the first field"),
        (check.through_chain, lambda f, x, n: by_table(scaled(f, n), x, n), "length 1 / n_steps"),
        (check.through_chain, lambda f, x, n: by_table(scaled(f, 1 / len(f)), x, n), "a share of it"),
    ],
)
def test_usual_mistakes_get_their_hint(hinted, checker, function, hint):
    hinted(checker, function, hint)


def one_sided(points, truths, curvatures, most):
    """The direction from the true points alone."""
    weights = np.minimum(1 + curvatures.numpy(), most)
    return (weights * KDTree(points.numpy()).query(truths.numpy())[0] ** 2).mean()


def scaled(fields, factor):
    return [lambda x, field=field: factor * field(x) for field in fields]


def test_the_midpoint_rule_is_named(hinted):
    def midpoint(fields, points, n_steps):
        for field in fields:
            for _ in range(n_steps):
                points = points + field(points + field(points) / (2 * n_steps)) / n_steps
        return points

    hinted(check.through_chain, midpoint, "midpoint rule")
