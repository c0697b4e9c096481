"""The exercises of chapter 22: two points, the weights of a window, partial transport as a linear program."""

import math

import numpy as np
import scipy.optimize
import torch

from meshot.types import Array, Float, Tensor
from meshot_book.exercises.verdict import Case, Mistake, check_answer


def pair_costs(function: object) -> None:
    """Check ``function(gap, reach)``: the partial and the unbalanced cost of two points of mass one on a line."""
    mistakes = [
        Mistake(
            lambda gap, reach: (min(gap, 2 * reach), _unbalanced(gap, reach)),
            "mass is removed and added for the reach in total, not for the reach on either side",
        ),
        Mistake(
            lambda gap, reach: (gap, _unbalanced(gap, reach)),
            "the first cost is that of transport; from which distance on is it cheaper to remove and to add the mass?",
        ),
        Mistake(
            lambda gap, reach: (min(gap, reach), _unbalanced(gap, 2 * reach)),
            "in the second cost the weight of the penalty is half the reach",
        ),
        Mistake(
            lambda gap, reach: (min(gap, reach), reach * math.exp(-gap / reach)),
            "the second cost is largest for points in one place; it should be zero there",
        ),
        Mistake(
            lambda gap, reach: (min(gap, reach), 1 - math.exp(-gap / reach)),
            "the second cost has no unit; its largest value is the reach",
        ),
        Mistake(
            lambda gap, reach: (min(gap, reach), gap * math.exp(-gap / reach)),
            "the second cost is only the transport of the mass that is left; add the two penalties",
        ),
        Mistake(lambda gap, reach: (_unbalanced(gap, reach), min(gap, reach)), "the two costs are exchanged"),
    ]
    cases = [
        Case("points that are near", (0.5, 5.0)),
        Case("points at the reach", (5.0, 5.0)),
        Case("points that are far apart", (80.0, 5.0)),
        Case("points in one place", (0.0, 2.0)),
        Case("a reach of one", (1.7, 1.0)),
    ]
    check_answer(function, lambda gap, reach: (min(gap, reach), _unbalanced(gap, reach)), cases, mistakes, "pair_costs")


def _unbalanced(gap: float, reach: float) -> float:
    return reach * (1 - math.exp(-gap / reach))


def window_weights(function: object) -> None:
    """Check ``function(points, weights, centre, radius)``: the masses within a window, with sum one."""
    mistakes = [
        Mistake(
            lambda *a: _weights(*a, total=False), "the masses in the window do not sum to one; divide by their sum"
        ),
        Mistake(lambda *a: _weights(*a, cut=math.inf), "the window ends at 2.5 radii; beyond, the weights are zero"),
        Mistake(lambda *a: _weights(*a, cut=1.0), "the window ends at 2.5 radii, not at one"),
        Mistake(
            lambda *a: _weights(*a, spread=1.0),
            "the radius is the standard deviation of the Gaussian; divide the squared distance by 2 radius²",
        ),
        Mistake(lambda *a: _weights(*a, spread=math.inf), "within the window the weights decrease, by a Gaussian"),
        Mistake(
            lambda p, w, c, r: _weights(p, torch.ones_like(w), c, r),
            "the masses of the points are left out; multiply them by the Gaussian",
        ),
    ]
    random = np.random.default_rng(0)
    points, weights = torch.from_numpy(random.normal(size=(30, 3))), torch.from_numpy(random.dirichlet(np.ones(30)))
    flat = torch.tensor([[0.0, 0.0], [1.0, 0.0], [2.4, 0.0], [2.6, 0.0]], dtype=torch.float64)
    cases = [
        Case("points around the centre", (points, weights, torch.zeros(3, dtype=torch.float64), 0.7)),
        Case("a centre aside", (points, weights, points[3], 0.4)),
        Case("points on both sides of the end of a window", (flat, torch.full((4,), 0.25).double(), flat[0], 1.0)),
        Case("a wide window", (points, weights, points[0], 50.0)),
    ]
    check_answer(function, _weights, cases, mistakes, "window_weights")


def _weights(
    points: Float[Tensor, "n d"],
    weights: Float[Tensor, " n"],
    centre: Float[Tensor, " d"],
    radius: float,
    cut: float = 2.5,
    spread: float = 2.0,
    total: bool = True,
) -> Float[Tensor, " n"]:
    squared = (points - centre).square().sum(dim=1)
    inside = weights * torch.exp(-squared / (spread * radius**2)) * (squared < (cut * radius) ** 2)
    return inside / inside.sum() if total else inside


def partial_cost(function: object) -> None:
    """Check ``function(positions, masses, reach)``: the partial cost between the positive and the negative masses."""
    mistakes = [
        Mistake(
            lambda z, m, reach: _dual(z, m, math.inf),
            "this is the cost of transport without removal; bound the values of the function, too",
        ),
        Mistake(
            lambda z, m, reach: _dual(z, m, 2 * reach),
            "the function is bounded by half the reach: to remove and to add costs the reach in total",
        ),
        Mistake(lambda z, m, reach: _dual(z, m, reach / 2), "the bound is half the reach, not a quarter of it"),
        Mistake(
            lambda z, m, reach: reach / 2 * np.abs(m).sum(),
            "this removes all mass; transport is cheaper where both kinds of mass are near",
        ),
        Mistake(
            lambda z, m, reach: min(_dual(z, m, math.inf), reach / 2 * np.abs(m).sum()),
            "this transports everything or removes everything; some mass may be removed and the rest transported",
        ),
        Mistake(lambda z, m, reach: -_dual(z, m, reach), "the sign is wrong: linprog returns a minimum"),
    ]
    random = np.random.default_rng(1)

    def drawn(n: int) -> tuple[Array, Array]:
        masses = random.normal(size=n)
        return np.sort(random.normal(size=n) * 5), masses - masses.mean()

    cases = [
        Case("seven points", (*drawn(7), 2.0)),
        Case("twelve points and a short reach", (*drawn(12), 0.3)),
        Case(
            "a pair beyond the reach, and one within it", (np.array([0.0, 1, 30, 50]), np.array([1.0, -1, 1, -1]), 8.0)
        ),
        Case("a long reach", (*drawn(9), 400.0)),
        Case("positions out of order", (np.array([3.0, 0, 9, 1]), np.array([0.5, -0.2, -0.6, 0.3]), 4.0)),
    ]
    check_answer(function, _dual, cases, mistakes, "partial_cost")


def _dual(positions: Float[Array, " n"], masses: Float[Array, " n"], reach: float) -> float:
    """The largest Σ m f over functions f with Lipschitz constant 1 and values in [−reach/2, reach/2]."""
    order = np.argsort(positions)
    gaps, rises = np.diff(positions[order]), np.diff(np.eye(len(order)), axis=0)
    bound = None if math.isinf(reach) else reach / 2
    found = scipy.optimize.linprog(
        -masses[order],
        A_ub=np.vstack([rises, -rises]),
        b_ub=np.concatenate([gaps, gaps]),
        bounds=(0 if bound is None else -bound, bound),
        method="highs",
    )
    return -found.fun
