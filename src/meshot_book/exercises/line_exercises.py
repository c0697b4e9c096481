"""Chapter 02: quantiles of weighted points, transport by merging, and the gradient in the weights."""

import numpy as np
import torch

from meshot.types import Float, Tensor
from meshot_book.exercises.verdict import Case, Mistake, check_answer


def quantiles(function: object) -> None:
    """Check ``function(points, weights, levels)``: the least point below or at which a share of the mass lies."""
    mistakes = [
        Mistake(
            lambda x, a, z: x[_first(a.cumsum(dim=0), z, len(x))],
            "the points are not sorted; sort them first, and reorder their masses in the same way",
        ),
        Mistake(
            lambda x, a, z: x.sort().values[_first(a.cumsum(dim=0), z, len(x))],
            "the points are sorted, but each must keep its own mass: sort the weights by the points' order",
        ),
        Mistake(
            lambda x, a, z: x.sort().values[(z * len(x)).ceil().long().sub(1).clamp(min=0)],
            "this counts points; add up the weights instead of counting",
        ),
        Mistake(
            lambda x, a, z: _quantiles(x, a, z, right=True),
            "where a level is reached exactly, the point that reaches it is the quantile (≥, not >)",
        ),
        Mistake(
            lambda x, a, z: torch.quantile(x, z),
            "the quantile function is piecewise constant: do not interpolate, and use the masses",
        ),
    ]
    generator = np.random.default_rng(0)
    x, levels = _normal(generator, 7), torch.from_numpy(generator.uniform(0.02, 0.98, size=9))
    eighths = torch.tensor([1.0, 3, 2, 1, 1], dtype=torch.float64) / 8
    cases = [
        Case("7 points of equal mass", (x, torch.full_like(x, 1 / 7), levels)),
        Case("7 points of unequal mass", (x, _masses(generator, 7), levels)),
        Case(
            "levels that are reached exactly", (_normal(generator, 5), eighths, torch.tensor([1, 4, 6, 7]).double() / 8)
        ),
        Case("one point", (x[:1], torch.ones(1, dtype=torch.float64), levels)),
        Case("two points in one place", (torch.tensor([2.0, 1.0, 2.0]).double(), _masses(generator, 3), levels)),
        Case("a point without mass", (x[:3], torch.tensor([0.25, 0.0, 0.75]).double(), levels)),
    ]
    check_answer(function, _quantiles, cases, mistakes, "quantiles")


def transport_cost(function: object) -> None:
    """Check ``function(source, source_weights, target, target_weights, p)``: W_p^p on a line for any weights."""
    mistakes = [
        Mistake(lambda *c: _cost(*c) ** (1 / c[4]), "this is the distance; leave out the root, W_p^p is asked for"),
        Mistake(lambda *c: _cost(*c[:4], 2), "the exponent is 2 whatever p is"),
        Mistake(
            _signed, "positive and negative differences cancel: take the absolute value on every cell, then the power"
        ),
        Mistake(
            lambda *c: _cost(c[0].sort().values, *c[1:]),
            "the source is sorted without its masses: sort the weights by the points' order",
        ),
        Mistake(
            lambda *c: _cost(c[0].sort().values, c[1], c[2].sort().values, *c[3:]),
            "both sides are sorted without their masses: sort the weights by the points' order",
        ),
        Mistake(
            lambda *c: _paired(*c),
            "ranks are paired and masses ignored: a point with a large mass has several partners",
        ),
        Mistake(
            lambda *c: _independent(*c), "every source point sends mass to every target point; use the sorted coupling"
        ),
    ]
    generator = np.random.default_rng(1)
    x, y = _normal(generator, 6), _normal(generator, 6) + 0.5
    equal, a, b = torch.full_like(x, 1 / 6), _masses(generator, 6), _masses(generator, 6)
    cases = [
        Case("6 and 6 points of equal mass", (x, equal, y, equal, 2.0)),
        Case("6 and 6 points of unequal mass", (x, a, y, b, 2.0)),
        Case("p = 1", (x, a, y, b, 1.0)),
        Case("p = 3", (x, a, y, b, 3.0)),
        Case("6 and 4 points", (x, a, y[:4], _masses(generator, 4), 2.0)),
        Case("one point and six", (x[:1], torch.ones(1, dtype=torch.float64), y, b, 1.5)),
        Case("the same measure twice, shuffled", (x, a, x.flip(0), a.flip(0), 2.0)),
    ]
    check_answer(function, _cost, cases, mistakes, "transport_cost")


def weight_gradient(function: object) -> None:
    """Check ``function(source, source_weights, target, target_weights, p)``: ∂W_p^p/∂a, of mean zero under a."""
    mistakes = [
        Mistake(
            lambda *c: -_potential(*c), "the sign is reversed: where mass is more expensive, the gradient is larger"
        ),
        Mistake(
            lambda *c: _potential(*c) - _potential(*c)[c[0].argmin()],
            "right up to a constant: subtract the mean under the weights a",
        ),
        Mistake(
            lambda *c: _potential(*c) - _potential(*c).mean(),
            "right up to a constant: the mean to subtract is the one under the weights a, not the plain one",
        ),
        Mistake(
            lambda *c: _potential(*c)[c[0].argsort()],
            "the values are right, but in the order of the sorted points: return them in the original order",
        ),
        Mistake(
            _own_cost,
            "this is the cost of each point alone; more mass here also changes the partners of all later points",
        ),
    ]
    generator = np.random.default_rng(2)
    x, y = _normal(generator, 5), _normal(generator, 7) + 1
    a, b = _masses(generator, 5), _masses(generator, 7)
    cases = [
        Case("5 and 7 points, p = 2", (x, a, y, b, 2.0)),
        Case("5 and 7 points, p = 1", (x, a, y, b, 1.0)),
        Case("sides exchanged, p = 3", (y, b, x, a, 3.0)),
        Case("one target point", (x, a, y[:1], torch.ones(1, dtype=torch.float64), 2.0)),
        Case("one source point", (x[:1], torch.ones(1, dtype=torch.float64), y, b, 2.0)),
    ]
    check_answer(function, _potential, cases, mistakes, "weight_gradient")


def _normal(generator: np.random.Generator, n: int) -> Float[Tensor, " n"]:
    return torch.from_numpy(generator.normal(size=n))


def _masses(generator: np.random.Generator, n: int) -> Float[Tensor, " n"]:
    return torch.from_numpy(generator.dirichlet(np.full(n, 2.0)))


def _first(ends: Tensor, levels: Tensor, n_points: int, right: bool = False) -> Tensor:
    return torch.searchsorted(ends, levels, right=right).clamp(max=n_points - 1)


def _quantiles(points: Tensor, weights: Tensor, levels: Tensor, right: bool = False) -> Tensor:
    order = points.argsort()
    return points[order][_first(weights[order].cumsum(dim=0), levels, len(points), right)]


def _cells(a: Tensor, b: Tensor) -> tuple[Tensor, Tensor]:
    """The cells of the merged jumps: middles and lengths."""
    cuts = torch.cat([a.cumsum(dim=0), b.cumsum(dim=0)]).clamp(0, 1).sort().values
    cuts = torch.cat([cuts.new_zeros(1), cuts])
    return (cuts[1:] + cuts[:-1]) / 2, torch.diff(cuts)


def _gaps(x: Tensor, a: Tensor, y: Tensor, b: Tensor) -> tuple[Tensor, Tensor]:
    x_order, y_order = x.argsort(stable=True), y.argsort(stable=True)
    middles, masses = _cells(a[x_order], b[y_order])
    return _quantiles(x, a, middles) - _quantiles(y, b, middles), masses


def _cost(x: Tensor, a: Tensor, y: Tensor, b: Tensor, p: float) -> Tensor:
    gaps, masses = _gaps(x, a, y, b)
    return (masses * gaps.abs() ** p).sum()


def _signed(x: Tensor, a: Tensor, y: Tensor, b: Tensor, p: float) -> Tensor:
    gaps, masses = _gaps(x, a, y, b)
    return (masses * gaps).sum().abs() ** p


def _paired(x: Tensor, a: Tensor, y: Tensor, b: Tensor, p: float) -> Tensor:
    n = min(len(x), len(y))
    return (x.sort().values[:n] - y.sort().values[:n]).abs().pow(p).mean()


def _independent(x: Tensor, a: Tensor, y: Tensor, b: Tensor, p: float) -> Tensor:
    return a @ (x[:, None] - y).abs() ** p @ b


def _potential(x: Tensor, a: Tensor, y: Tensor, b: Tensor, p: float) -> Tensor:
    """Between two neighbours of the source the potential rises by what the target between them makes of it."""
    order = x.argsort()
    places, ends = x[order], a[order].cumsum(dim=0)[:-1]
    partner = _quantiles(y, b, ends)
    rises = (places[1:] - partner).abs() ** p - (places[:-1] - partner).abs() ** p
    found = torch.empty_like(x)
    found[order] = torch.cat([x.new_zeros(1), rises.cumsum(dim=0)])
    return found - a @ found


def _own_cost(x: Tensor, a: Tensor, y: Tensor, b: Tensor, p: float) -> Tensor:
    """The mean cost of what each point sends, shifted as asked."""
    order = x.argsort()
    gaps, masses = _gaps(x, a, y, b)
    middles, _ = _cells(a[order], b[y.argsort()])
    owner = order[_first(a[order].cumsum(dim=0), middles, len(x))]
    paid = torch.zeros_like(x).index_add(0, owner, masses * gaps.abs() ** p) / a
    return paid - a @ paid
