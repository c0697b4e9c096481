"""The exercises of chapter 22: truths from elsewhere, and a different hint for each usual mistake."""

import math

import numpy as np
import pytest
import scipy.optimize
import torch

from meshot import DiscreteMeasure
from meshot.loss import sliced_partial, sliced_unbalanced
from meshot_book.exercises import check

LINE = torch.ones(1, 1, dtype=torch.float64)


def by_losses(gap, reach):
    pair = [DiscreteMeasure(torch.tensor([[float(x)]], dtype=torch.float64)) for x in (0, gap)]
    return [float(loss(*pair, reach, LINE)) for loss in (sliced_partial, sliced_unbalanced)]


def by_loop(points, weights, centre, radius):
    found = []
    for point, weight in zip(points, weights, strict=True):
        apart = math.dist(point.tolist(), centre.tolist())
        found.append(float(weight) * math.exp(-((apart / radius) ** 2) / 2) if apart < 2.5 * radius else 0.0)
    return np.array(found) / sum(found)


def by_plan(positions, masses, reach):
    """The primal problem: what is transported, for every pair of a positive and a negative mass."""
    here, there = np.flatnonzero(masses > 0), np.flatnonzero(masses < 0)
    costs = np.abs(positions[here][:, None] - positions[there]) - reach
    sums = np.vstack([np.kron(np.eye(len(here)), np.ones(len(there))), np.kron(np.ones(len(here)), np.eye(len(there)))])
    found = scipy.optimize.linprog(costs.ravel(), A_ub=sums, b_ub=np.abs(masses[np.concatenate([here, there])]))
    return found.fun + reach / 2 * np.abs(masses).sum()


@pytest.mark.parametrize(
    ("checker", "function"),
    [(check.pair_costs, by_losses), (check.window_weights, by_loop), (check.partial_cost, by_plan)],
)
def test_independent_solutions_pass(capsys, checker, function):
    checker(function)
    assert capsys.readouterr().out.startswith("✓")


def soft(gap, reach):
    return reach * (1 - math.exp(-gap / reach))


def weighted(p, w, c, r, cut=2.5, spread=2.0):
    squared = ((p - c) ** 2).sum(1)
    inside = w * torch.exp(-squared / spread / r**2) * (squared < (cut * r) ** 2)
    return inside / inside.sum()


MISTAKES = {
    "pair_costs": {
        "not for the reach on either side": lambda g, r: (min(g, 2 * r), soft(g, r)),
        "from which distance on": lambda g, r: (g, soft(g, r)),
        "is half the reach": lambda g, r: (min(g, r), soft(g, 2 * r)),
        "largest for points in one place": lambda g, r: (min(g, r), r * math.exp(-g / r)),
        "has no unit": lambda g, r: (min(g, r), 1 - math.exp(-g / r)),
        "add the two penalties": lambda g, r: (min(g, r), g * math.exp(-g / r)),
        "exchanged": lambda g, r: (soft(g, r), min(g, r)),
    },
    "window_weights": {
        "divide by their sum": lambda p, w, c, r: (
            w * torch.exp(-((p - c) ** 2).sum(1) / 2 / r**2) * (((p - c) ** 2).sum(1) < (2.5 * r) ** 2)
        ),
        "beyond, the weights are zero": lambda *a: weighted(*a, cut=math.inf),
        "not at one": lambda *a: weighted(*a, cut=1.0),
        "2 radius²": lambda *a: weighted(*a, spread=1.0),
        "decrease, by a Gaussian": lambda *a: weighted(*a, spread=math.inf),
        "masses of the points are left out": lambda p, w, c, r: weighted(p, torch.ones_like(w), c, r),
    },
    "partial_cost": {
        "bound the values": lambda z, m, r: by_plan(z, m, 1e4),
        "half the reach: to remove": lambda z, m, r: by_plan(z, m, 2 * r),
        "not a quarter": lambda z, m, r: by_plan(z, m, r / 2),
        "this removes all mass": lambda z, m, r: r / 2 * np.abs(m).sum(),
        "transports everything or removes": lambda z, m, r: min(by_plan(z, m, 1e4), r / 2 * np.abs(m).sum()),
        "the sign is wrong": lambda z, m, r: -by_plan(z, m, r),
    },
}


@pytest.mark.parametrize(
    ("name", "hint", "function"), [(n, hint, f) for n, hints in MISTAKES.items() for hint, f in hints.items()]
)
def test_each_mistake_has_its_hint(hinted, name, hint, function):
    hinted(getattr(check, name), function, hint)
