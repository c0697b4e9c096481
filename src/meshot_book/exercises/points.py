"""Exercises of part I, losses on points: truths, cases, and the usual mistakes with their hints."""

import math

import numpy as np
import torch

from meshot.types import Float, Tensor
from meshot_book.exercises.given import EntropicCost, of_a_pair, rest_and_distance
from meshot_book.exercises.verdict import Exercise, exercise

# Chapter 1: descent directions of both losses, and the learning rate that momentum allows.


@exercise(stars=1)
def nearest_arrows() -> Exercise:
    """Check ``function(points, target)``: for every point, the vector to the nearest target point."""

    def nearest(points: Float[Tensor, "n d"], target: Float[Tensor, "m d"]) -> Float[Tensor, "n d"]:
        return target[(points[:, None] - target[None]).square().sum(dim=2).argmin(dim=1)]

    def to_nearest(points: Float[Tensor, "n d"], target: Float[Tensor, "m d"]) -> Float[Tensor, "n d"]:
        return nearest(points, target) - points

    def unit_pull(points: Float[Tensor, "n d"], target: Float[Tensor, "m d"]) -> Float[Tensor, "n d"]:
        arrows = to_nearest(points, target)
        lengths = arrows.norm(dim=1, keepdim=True)
        return arrows / torch.where(lengths > 0, lengths, torch.ones_like(lengths))

    generator = np.random.default_rng(0)
    x, y = (torch.from_numpy(generator.normal(size=(n, 2))) for n in (7, 7))
    cases = {
        "7 points and 7 targets": (x, y),
        "5 points and 9 targets": (x[:5], torch.cat([y, y[:2] + 3])),
        "one point and three targets": (x[:1], y[:3]),
        "points that lie on the target already": (y, y),
        "points far from the target": (x + 100, y),
        "points in R³": tuple(torch.from_numpy(generator.normal(size=(n, 3))) for n in (6, 4)),
        "one target straight above and one aslant": (
            torch.zeros(1, 2, dtype=torch.float64),
            torch.tensor([[0.0, 2.5], [1.7, 1.7], [-1.9, -1.9]], dtype=torch.float64),
        ),
    }
    mistakes = {
        "nearest by the sum of the absolute differences; take the length of the difference, the root of its squares": (
            lambda x, y: y[(x[:, None] - y[None]).abs().sum(dim=2).argmin(dim=1)] - x
        ),
        "the arrows point away from the target: subtract the point from the target, not the reverse": (
            lambda x, y: -to_nearest(x, y)
        ),
        "these are the nearest target points themselves; an arrow starts at the point": lambda x, y: nearest(x, y),
        "the smallest is looked for among the points, not among the targets: check the axis of the minimum": (
            lambda x, y: y[torch.cdist(x, y).argmin(dim=0)] - x
        ),
        "twice too long: the arrow is the difference vector, not the gradient": lambda x, y: 2 * to_nearest(x, y),
        "the directions are right, the lengths are all one: leave out the division by the norm": unit_pull,
        "every arrow ends at the mean of the target; take the nearest target point": lambda x, y: y.mean(dim=0) - x,
    }
    return Exercise(to_nearest, cases, mistakes)


@exercise(stars=2)
def line_arrows() -> Exercise:
    """Check ``function(points, target, direction)``: the arrow of transport along one direction at every point."""

    def along(
        points: Float[Tensor, "n d"], target: Float[Tensor, "n d"], direction: Float[Tensor, " d"]
    ) -> Float[Tensor, "n d"]:
        ranks = (points @ direction).argsort().argsort()
        return ((target @ direction).sort().values[ranks] - points @ direction)[:, None] * direction

    generator = np.random.default_rng(1)
    x, y = (torch.from_numpy(generator.normal(size=(8, 2))) for _ in range(2))
    u = torch.tensor([0.6, 0.8], dtype=torch.float64)
    solid = [torch.from_numpy(generator.normal(size=(5, 3))) for _ in range(2)]
    cases = {
        "8 points and a slanting direction": (x, y, u),
        "the same points, the direction reversed": (x, y, -u),
        "a horizontal direction": (x[:5], y[:5], torch.tensor([1.0, 0.0], dtype=torch.float64)),
        "one point": (x[:1], y[:1], u),
        "a target that is the points, shuffled": (x, x.flip(0), u),
        "points in R³": (*solid, torch.tensor([2.0, -1.0, 2.0], dtype=torch.float64) / 3),
    }
    mistakes = {
        "the arrows point away from the target: subtract the point from the target, not the reverse": (
            lambda x, y, u: -along(x, y, u)
        ),
        "the arrows are right but in the order of the sorted points: undo the sorting": (
            lambda x, y, u: ((y @ u).sort().values - (x @ u).sort().values)[:, None] * u
        ),
        "points are paired in their original order; transport on a line pairs them by rank: sort both sides": (
            lambda x, y, u: (y @ u - x @ u)[:, None] * u
        ),
        "the points are ranked, but the targets are not sorted": (
            lambda x, y, u: ((y @ u)[(x @ u).argsort().argsort()] - x @ u)[:, None] * u
        ),
        "argsort gives the order, not the ranks: apply argsort again, or assign through the order": (
            lambda x, y, u: ((y @ u).sort().values[(x @ u).argsort()] - x @ u)[:, None] * u
        ),
        "the partners are right, but a direction moves points along itself only: project the arrow on it": (
            lambda x, y, u: y[(y @ u).argsort()[(x @ u).argsort().argsort()]] - x
        ),
    }
    return Exercise(along, cases, mistakes)


@exercise(stars=3)
def largest_rate() -> Exercise:
    """Check ``function(n_selections, momentum)``: the learning rate at which summed Chamfer becomes unstable."""
    pairs = [(0, 0.0), (0, 0.9), (1, 0.0), (1, 0.9), (4, 0.5), (30, 0.9), (678, 0.99)]
    cases = {f"{n} selections and momentum {momentum}": (n, momentum) for n, momentum in pairs}
    mistakes = {
        "that is the bound without momentum; with momentum larger steps are stable": lambda k, b: 1 / (1 + k),
        "this does not depend on the number of selections; the curvature at such a point does": (
            lambda k, b: 2 * (1 + b)
        ),
        "each selection is one square, and the point has a nearest target point too: one more square": (
            lambda k, b: (1 + b) / k if k else 2 * (1 + b)
        ),
        "the curvature of |x − y|² is 2, not 1": lambda k, b: 2 * (1 + b) / (1 + k),
        "the sign of the momentum is wrong: 1 − momentum sets the speed, not the stability": (
            lambda k, b: (1 - b) / (1 + k)
        ),
    }
    return Exercise(lambda n, momentum: (1 + momentum) / (1 + n), cases, mistakes)


# Chapter 2: quantiles of weighted points, transport by merging, and the gradient in the weights.


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


@exercise(stars=1)
def quantiles() -> Exercise:
    """Check ``function(points, weights, levels)``: the least point below or at which a share of the mass lies."""
    generator = np.random.default_rng(0)
    x, levels = _normal(generator, 7), torch.from_numpy(generator.uniform(0.02, 0.98, size=9))
    eighths = torch.tensor([1.0, 3, 2, 1, 1], dtype=torch.float64) / 8
    cases = {
        "7 points of equal mass": (x, torch.full_like(x, 1 / 7), levels),
        "7 points of unequal mass": (x, _masses(generator, 7), levels),
        "levels that are reached exactly": (_normal(generator, 5), eighths, torch.tensor([1, 4, 6, 7]).double() / 8),
        "one point": (x[:1], torch.ones(1, dtype=torch.float64), levels),
        "two points in one place": (torch.tensor([2.0, 1.0, 2.0]).double(), _masses(generator, 3), levels),
        "a point without mass": (x[:3], torch.tensor([0.25, 0.0, 0.75]).double(), levels),
    }
    mistakes = {
        "the points are not sorted; sort them first, and reorder their masses in the same way": (
            lambda x, a, z: x[_first(a.cumsum(dim=0), z, len(x))]
        ),
        "the points are sorted, but each must keep its own mass: sort the weights by the points' order": (
            lambda x, a, z: x.sort().values[_first(a.cumsum(dim=0), z, len(x))]
        ),
        "this counts points; add up the weights instead of counting": (
            lambda x, a, z: x.sort().values[(z * len(x)).ceil().long().sub(1).clamp(min=0)]
        ),
        "where a level is reached exactly, the point that reaches it is the quantile (≥, not >)": (
            lambda x, a, z: _quantiles(x, a, z, right=True)
        ),
        "the quantile function is piecewise constant: do not interpolate, and use the masses": (
            lambda x, a, z: torch.quantile(x, z)
        ),
    }
    return Exercise(_quantiles, cases, mistakes)


@exercise(stars=2)
def transport_cost() -> Exercise:
    """Check ``function(source, source_weights, target, target_weights, p)``: W_p^p on a line for any weights."""

    def cost(x: Tensor, a: Tensor, y: Tensor, b: Tensor, p: float) -> Tensor:
        gaps, masses = _gaps(x, a, y, b)
        return (masses * gaps.abs() ** p).sum()

    def signed(x: Tensor, a: Tensor, y: Tensor, b: Tensor, p: float) -> Tensor:
        gaps, masses = _gaps(x, a, y, b)
        return (masses * gaps).sum().abs() ** p

    def paired(x: Tensor, a: Tensor, y: Tensor, b: Tensor, p: float) -> Tensor:
        n = min(len(x), len(y))
        return (x.sort().values[:n] - y.sort().values[:n]).abs().pow(p).mean()

    def independent(x: Tensor, a: Tensor, y: Tensor, b: Tensor, p: float) -> Tensor:
        return a @ (x[:, None] - y).abs() ** p @ b

    generator = np.random.default_rng(1)
    x, y = _normal(generator, 6), _normal(generator, 6) + 0.5
    equal, a, b = torch.full_like(x, 1 / 6), _masses(generator, 6), _masses(generator, 6)
    cases = {
        "6 and 6 points of equal mass": (x, equal, y, equal, 2.0),
        "6 and 6 points of unequal mass": (x, a, y, b, 2.0),
        "p = 1": (x, a, y, b, 1.0),
        "p = 3": (x, a, y, b, 3.0),
        "6 and 4 points": (x, a, y[:4], _masses(generator, 4), 2.0),
        "one point and six": (x[:1], torch.ones(1, dtype=torch.float64), y, b, 1.5),
        "the same measure twice, shuffled": (x, a, x.flip(0), a.flip(0), 2.0),
    }
    mistakes = {
        "this is the distance; leave out the root, W_p^p is asked for": lambda *c: cost(*c) ** (1 / c[4]),
        "the exponent is 2 whatever p is": lambda *c: cost(*c[:4], 2),
        "positive and negative differences cancel: take the absolute value on every cell, then the power": signed,
        "the source is sorted without its masses: sort the weights by the points' order": (
            lambda *c: cost(c[0].sort().values, *c[1:])
        ),
        "both sides are sorted without their masses: sort the weights by the points' order": (
            lambda *c: cost(c[0].sort().values, c[1], c[2].sort().values, *c[3:])
        ),
        "ranks are paired and masses ignored: a point with a large mass has several partners": lambda *c: paired(*c),
        "every source point sends mass to every target point; use the sorted coupling": lambda *c: independent(*c),
    }
    return Exercise(cost, cases, mistakes)


@exercise(stars=3)
def weight_gradient() -> Exercise:
    """Check ``function(source, source_weights, target, target_weights, p)``: ∂W_p^p/∂a, of mean zero under a."""

    def potential(x: Tensor, a: Tensor, y: Tensor, b: Tensor, p: float) -> Tensor:
        """Between two neighbours of the source the potential rises by what the target between them makes of it."""
        order = x.argsort()
        places, ends = x[order], a[order].cumsum(dim=0)[:-1]
        partner = _quantiles(y, b, ends)
        rises = (places[1:] - partner).abs() ** p - (places[:-1] - partner).abs() ** p
        found = torch.empty_like(x)
        found[order] = torch.cat([x.new_zeros(1), rises.cumsum(dim=0)])
        return found - a @ found

    def own_cost(x: Tensor, a: Tensor, y: Tensor, b: Tensor, p: float) -> Tensor:
        """The mean cost of what each point sends, shifted as asked."""
        order = x.argsort()
        gaps, masses = _gaps(x, a, y, b)
        middles, _ = _cells(a[order], b[y.argsort()])
        owner = order[_first(a[order].cumsum(dim=0), middles, len(x))]
        paid = torch.zeros_like(x).index_add(0, owner, masses * gaps.abs() ** p) / a
        return paid - a @ paid

    generator = np.random.default_rng(2)
    x, y = _normal(generator, 5), _normal(generator, 7) + 1
    a, b = _masses(generator, 5), _masses(generator, 7)
    cases = {
        "5 and 7 points, p = 2": (x, a, y, b, 2.0),
        "5 and 7 points, p = 1": (x, a, y, b, 1.0),
        "sides exchanged, p = 3": (y, b, x, a, 3.0),
        "one target point": (x, a, y[:1], torch.ones(1, dtype=torch.float64), 2.0),
        "one source point": (x[:1], torch.ones(1, dtype=torch.float64), y, b, 2.0),
    }
    mistakes = {
        "the sign is reversed: where mass is more expensive, the gradient is larger": lambda *c: -potential(*c),
        "right up to a constant: subtract the mean under the weights a": (
            lambda *c: potential(*c) - potential(*c)[c[0].argmin()]
        ),
        "right up to a constant: the mean to subtract is the one under the weights a, not the plain one": (
            lambda *c: potential(*c) - potential(*c).mean()
        ),
        "the values are right, but in the order of the sorted points: return them in the original order": (
            lambda *c: potential(*c)[c[0].argsort()]
        ),
        "this is the cost of each point alone; more mass here also changes the partners of all later points": own_cost,
    }
    return Exercise(potential, cases, mistakes)


# Chapter 3: sliced Wasserstein from scratch, how many lines it takes, and pairs that no line of a set tells apart.


def _sliced_gaps(
    points: Float[Tensor, "n d"], target: Float[Tensor, "n d"], directions: Float[Tensor, "L d"]
) -> Tensor:
    return (directions @ points.T).sort(dim=1).values - (directions @ target.T).sort(dim=1).values


def _sliced(points: Float[Tensor, "n d"], target: Float[Tensor, "n d"], directions: Float[Tensor, "L d"]) -> Tensor:
    return _sliced_gaps(points, target, directions).square().mean()


@exercise(stars=1)
def sliced_cost() -> Exercise:
    """Check ``function(points, target, directions)``: SW₂² of equally many points of equal mass over given lines."""
    generator = np.random.default_rng(0)
    x, y = (torch.from_numpy(generator.normal(size=(8, 3)) + shift) for shift in (0, 0.7))
    u = torch.nn.functional.normalize(torch.from_numpy(generator.normal(size=(5, 3))), dim=1)
    cases = {
        "8 points in R³ and 5 lines": (x, y, u),
        "the same points in another order": (x, x.flip(0), u),
        "one point on either side": (x[:1], y[:1], u),
        "one line": (x, y, u[:1]),
        "points in R²": (x[:, :2], y[:, :2], torch.eye(2, dtype=torch.float64)),
        "points that project to the same place": (x[[0, 0, 1]], y[[2, 2, 2]], u),
    }
    mistakes = {
        "points are paired in their original order; sort both sides on every line": (
            lambda x, y, u: (u @ x.T - u @ y.T).square().mean()
        ),
        "sorted across the lines, not along each one: check the axis of the sort": (
            lambda x, y, u: ((u @ x.T).sort(dim=0).values - (u @ y.T).sort(dim=0).values).square().mean()
        ),
        "the coordinates are sorted before projecting, which mixes the points: project first": (
            lambda x, y, u: (u @ x.sort(dim=0).values.T - u @ y.sort(dim=0).values.T).square().mean()
        ),
        "a sum over the points; every point carries mass 1/n": lambda x, y, u: len(x) * _sliced(x, y, u),
        "a sum over the lines; the loss is their mean": lambda x, y, u: len(u) * _sliced(x, y, u),
        "this is SW₂; the loss is its square: leave the root out": lambda x, y, u: _sliced(x, y, u).sqrt(),
        "distances are not squared: this is SW₁": lambda x, y, u: _sliced_gaps(x, y, u).abs().mean(),
        "a root is taken on every line before the mean; average the squares": (
            lambda x, y, u: _sliced_gaps(x, y, u).square().mean(dim=1).sqrt().mean()
        ),
    }
    return Exercise(_sliced, cases, mistakes)


@exercise(stars=2)
def lines_needed() -> Exercise:
    """Check ``function(costs, relative_error)``: how many random lines, judged by the costs on a few."""

    def lines(costs: Float[Tensor, " L"], relative_error: float) -> int:
        return math.ceil((float(costs.std() / costs.mean()) / relative_error) ** 2)

    generator = np.random.default_rng(1)
    costs = torch.from_numpy(generator.chisquare(1, size=12))
    cases = {
        "12 lines and 10 %": (costs, 0.1),
        "12 lines and 1 %": (costs, 0.01),
        "costs a hundred times larger": (100 * costs, 0.1),
        "three lines": (costs[:3], 0.05),
        "30 lines": (torch.from_numpy(generator.chisquare(1, size=30)), 0.02),
    }
    mistakes = {
        "this divides by the number of trial lines as well: use the deviation of one line, not of the mean": (
            lambda c, e: math.ceil(float(c.std() / c.mean() / math.sqrt(len(c)) / e) ** 2)
        ),
        "the error falls with the root of the number of lines: something is not squared": (
            lambda c, e: math.ceil(float(c.std() / c.mean() / e))
        ),
        "that is for an absolute error; a relative one is a share of the mean": (
            lambda c, e: math.ceil((float(c.std()) / e) ** 2)
        ),
        "the variance is biased: with the mean taken from the same lines, divide by their number less one": (
            lambda c, e: math.ceil(round((float(c.std(correction=0) / c.mean()) / e) ** 2, 9))
        ),
        "the mean is over the costs themselves; take no roots": (
            lambda c, e: math.ceil(float(c.sqrt().std() / c.sqrt().mean() / e) ** 2)
        ),
        "rounded down, which is one line short: round up": (
            lambda c, e: math.floor((float(c.std() / c.mean()) / e) ** 2)
        ),
        "the number of lines must be whole: round up": lambda c, e: (float(c.std() / c.mean()) / e) ** 2,
    }
    return Exercise(lines, cases, mistakes)


@exercise(stars=3)
def ghost_pair() -> Exercise:
    """Check ``function(directions)``: two different sets of points with the same projection on every line."""

    def swapped(directions: Float[Tensor, "L 2"]) -> tuple[Tensor, Tensor]:
        """For each line, both sets are doubled by a shift perpendicular to it, and the copies exchanged."""
        first, second = torch.zeros(1, 2, dtype=torch.float64), torch.zeros(0, 2, dtype=torch.float64)
        for x, y in directions.tolist():
            across = torch.tensor([-y, x], dtype=torch.float64)
            first, second = torch.cat([first, second + across]), torch.cat([second, first + across])
        return first, second

    generator = np.random.default_rng(2)
    angles = [torch.from_numpy(generator.uniform(0, np.pi, size=n)) for n in (1, 2, 3, 5)]
    lines = [torch.stack([angle.cos(), angle.sin()], dim=1) for angle in angles]
    lines += [torch.eye(2, dtype=torch.float64)]
    names = ("one line", "two lines", "three lines", "five lines", "the two axes")
    cases = {name: (line,) for name, line in zip(names, lines, strict=True)}
    mistakes = {
        "both sets are equal; two different sets are needed": lambda u: (u, u.flip(0)),
        "there must be equally many points in both sets": lambda u: (u, torch.zeros(len(u) + 1, 2)),
        "their projections differ on one of the lines; shift perpendicular to that line": (
            lambda u: (torch.zeros(1, 2), u[:1])
        ),
        "right for one line only: for the next line shift both sets perpendicular to it, then exchange the copies": (
            lambda u: swapped(u[:1])
        ),
    }
    return Exercise(swapped, cases, mistakes, of_a_pair)


# Chapter 4: a blur's unit, what flipped normals weigh, a debiased cost, and a trap for Chamfer.


@exercise(stars=1)
def blur_in_coordinates() -> Exercise:
    """Check ``function(blur_mm, half_extent_mm, p)``: blur and ε = blur^p once ±half_extent_mm has become ±1."""
    given = [(5.0, 100.0, 2), (5.0, 100.0, 1), (1.0, 90.0, 2), (0.3, 40.0, 1), (20.0, 10.0, 2)]
    cases = {f"{b} mm in a box of ±{r} mm, p = {p}": (b, r, p) for b, r, p in given}
    mistakes = {
        "multiplied instead of divided: coordinates are mm over the half extent": lambda b, r, p: (b * r, (b * r) ** p),
        "[-1, 1] is two units wide: one unit is the *half*": lambda b, r, p: (b / (2 * r), (b / (2 * r)) ** p),
        "the blur is right; ε must be in coordinates too, not in mm": lambda b, r, p: (b / r, b**p),
        "ε carries p powers of the length, so it is divided p times": lambda b, r, p: (b / r, b**p / r),
        "the blur is right; ε is a cost, the blur to the power p": lambda b, r, p: (b / r, b / r),
        "unchanged: right only if the half extent is 1 mm": lambda b, r, p: (b, b**p),
    }
    return Exercise(lambda b, r, p: (b / r, (b / r) ** p), cases, mistakes)


@exercise(stars=2)
def smallest_flip() -> Exercise:
    """Check ``function(floor_mm, normal_scale_mm)``: the share of a surface whose flipped normals reach the floor."""
    given = [(1.0, 10.0), (6.0, 10.0), (2.0, 1.0), (0.5, 3.0), (10.0, 87.0), (2.0, 0.5)]
    cases = {f"a floor of {f} mm and a normal scale of {s} mm": (f, s) for f, s in given}
    mistakes = {
        "a share cannot exceed 1: return 1 if even the whole surface is too little": lambda f, s: f**2 / (4 * s**2),
        "the cost is a *squared* distance times the share; f is a root": lambda f, s: min(1.0, f / (2 * s)),
        "a reversed unit normal moves by twice its length": lambda f, s: min(1.0, f**2 / s**2),
        "the square of 2 s is 4 s², not 2 s²": lambda f, s: min(1.0, f**2 / (2 * s**2)),
        "the quotient is inverted: a larger scale detects *smaller* flips": lambda f, s: min(1.0, 4 * s**2 / f**2),
        "this is the floor, a length in mm; a share has no unit": lambda f, s: f,
    }
    return Exercise(lambda f, s: min(1.0, f**2 / (4 * s**2)), cases, mistakes)


@exercise(stars=2)
def debiased() -> Exercise:
    """Check ``function(entropic, x, y, p)``: from a regularised cost ‖x − y‖^p / p to a divergence like W_p^p."""

    generator = np.random.default_rng(0)
    x, y = (torch.from_numpy(generator.normal(size=(n, 2))) for n in (5, 7))
    cases = {
        "5 and 7 points, p = 2": (EntropicCost(2), x, y, 2),
        "5 and 7 points, p = 1": (EntropicCost(1), x, y, 1),
        "a set and itself": (EntropicCost(2), x, x, 2),
        "a far translation": (EntropicCost(2), x, x + 9, 2),
    }
    mistakes = {
        "debiased; now undo the division by p": lambda c, x, y, p: c(x, y) - (c(x, x) + c(y, y)) / 2,
        "the factor is right; it is not zero for x = y: subtract the bias": lambda c, x, y, p: p * c(x, y),
        "this is the regularised cost itself, which is not zero for x = y: subtract the bias": (
            lambda c, x, y, p: c(x, y)
        ),
        "for x = y this is negative: take *half* of each": lambda c, x, y, p: p * (c(x, y) - c(x, x) - c(y, y)),
        "the answer changes when x and y are exchanged: subtract half of both biases": (
            lambda c, x, y, p: p * (c(x, y) - c(x, x))
        ),
        "divided instead of multiplied: the cost was divided by p": (
            lambda c, x, y, p: (c(x, y) - (c(x, x) + c(y, y)) / 2) / p
        ),
        "the factor p belongs to all three terms": lambda c, x, y, p: p * c(x, y) - (c(x, x) + c(y, y)) / 2,
    }
    return Exercise(lambda c, x, y, p: p * (c(x, y) - (c(x, x) + c(y, y)) / 2), cases, mistakes)


@exercise(stars=3)
def trap() -> Exercise:
    """Check ``function(target)``: as many points as the target has, at rest under Chamfer, and yet not the target.

    What is compared is not the points but two properties: whether all of them are at rest under Chamfer, and whether
    exact transport separates them from the target.
    """

    def merged_pair(target: Float[Tensor, "n d"]) -> Float[Tensor, "n d"]:
        """The two nearest targets share one point, a third of the way; the one left over doubles a third target."""
        apart = torch.cdist(target, target).fill_diagonal_(torch.inf)
        first, second = divmod(int(apart.argmin()), len(target))
        points = target.clone()
        points[first] = (2 * target[first] + target[second]) / 3
        points[second] = target[next(i for i in range(len(target)) if i not in (first, second))]
        return points

    generator = np.random.default_rng(0)
    rectangle = torch.tensor([[0.0, 0], [4, 0], [4, 1], [0, 1]], dtype=torch.float64)
    cases = {
        "the corners of a rectangle": (rectangle,),
        "four random points": (torch.from_numpy(generator.normal(size=(4, 2))),),
        "seven random points": (torch.from_numpy(generator.normal(size=(7, 2))),),
        "five points in R³": (torch.from_numpy(generator.normal(size=(5, 3))),),
    }
    mistakes = {
        "no point moves, but exact transport is zero as well: these are the target points themselves": lambda y: y,
        "a point still moves under Chamfer: add the arrows of the target points that select it": lambda y: y + 0.3,
        "a point still moves although exact transport is zero: the two conditions contradict each other": (
            lambda y: y + 1e-4
        ),
    }
    return Exercise(merged_pair, cases, mistakes, rest_and_distance)


# Chapter 6: weights of slices, a slice that lifts to a plan, and a step to a direction of larger cost.


@exercise(stars=1)
def slice_weights() -> Exercise:
    """Check ``function(costs, power)``: weights in proportion to a power of the costs."""

    def weights(costs: Tensor, power: float) -> Tensor:
        energies = costs**power if costs.any() else torch.ones_like(costs)
        return energies / energies.sum()

    costs = torch.from_numpy(np.random.default_rng(0).uniform(0.5, 4.0, size=6))
    cases = {
        "six costs, power 1": (costs, 1.0),
        "six costs, power 3": (costs, 3.0),
        "power 0": (costs, 0.0),
        "one cost": (costs[:1], 2.0),
        "a slice without cost": (torch.tensor([0.0, 1.0, 3.0]).double(), 1.0),
        "no cost at all": (torch.zeros(4).double(), 1.0),
    }
    mistakes = {
        "these are the powers; weights sum to one: divide by the sum": (
            lambda c, a: c**a if c.any() else torch.ones_like(c)
        ),
        "this is the exponential energy; a power is asked for": lambda c, a: torch.softmax(a * c, dim=0),
        "a larger cost has a larger weight, not a smaller one": (
            lambda c, a: weights(1 / c, a) if c.all() else weights(c.max() - c, a)
        ),
        "divided by the largest power; divide by the sum": (
            lambda c, a: c**a / (c**a).max() if c.any() else torch.ones_like(c)
        ),
        "the power is not used": lambda c, a: weights(c, 1.0),
    }
    return Exercise(weights, cases, mistakes)


def _by_order(x: Tensor, y: Tensor, direction: Tensor) -> Tensor:
    """Differences of the pairs that have the same rank along a direction."""
    return x[(x @ direction).argsort()] - y[(y @ direction).argsort()]


def _three_pairs(seed: int) -> dict[str, tuple[Tensor, Tensor, Tensor]]:
    generator = np.random.default_rng(seed)
    x, y = (torch.from_numpy(generator.normal(size=(7, 2))) for _ in range(2))
    u = torch.tensor([0.6, 0.8], dtype=torch.float64)
    solid = [torch.from_numpy(generator.normal(size=(5, 3))) for _ in range(2)]
    return {
        "two points and an axis": (x[:2], y[:2], torch.tensor([1.0, 0.0], dtype=torch.float64)),
        "7 points and a slanting direction": (x, y, u),
        "points in R³": (*solid, torch.tensor([2.0, -1.0, 2.0], dtype=torch.float64) / 3),
        "a translation": (x, x.flip(0) + torch.tensor([3.0, 1.0]).double(), u),
    }


@exercise(stars=2)
def lifted_cost() -> Exercise:
    """Check ``function(points, target, direction)``: the mean squared distance of pairs of the same rank."""

    def cost(x: Tensor, y: Tensor, u: Tensor) -> Tensor:
        return _by_order(x, y, u).square().sum(dim=1).mean()

    mistakes = {
        "this is the cost along the direction; sort the points of space, not their projections": (
            lambda x, y, u: (_by_order(x, y, u) @ u).square().mean()
        ),
        "points are paired in their original order; pair them by their order along the direction": (
            lambda x, y, u: (x - y).square().sum(dim=1).mean()
        ),
        "this is the sum over the pairs; take their mean": lambda x, y, u: _by_order(x, y, u).square().sum(),
        "squared distances are asked for: leave out the root": (lambda x, y, u: _by_order(x, y, u).norm(dim=1).mean()),
        "each coordinate is a term of its own here; sum over the coordinates, then take the mean over the pairs": (
            lambda x, y, u: _by_order(x, y, u).square().mean()
        ),
        "the points are sorted, but the targets are not": (
            lambda x, y, u: (x[(x @ u).argsort()] - y).square().sum(dim=1).mean()
        ),
        "one side is sorted in descending order": (
            lambda x, y, u: (x[(x @ u).argsort()] - y[(-y @ u).argsort()]).square().sum(dim=1).mean()
        ),
    }
    return Exercise(cost, _three_pairs(0), mistakes)


@exercise(stars=3)
def steeper() -> Exercise:
    """Check ``function(points, target, direction)``: the gradient of W₂² in the direction, normalised."""

    def slope(x: Tensor, y: Tensor, u: Tensor) -> Tensor:
        gaps = _by_order(x, y, u)
        return gaps.T @ (gaps @ u)

    def unit(vector: Tensor) -> Tensor:
        return vector / vector.norm()

    def tangent(x: Tensor, y: Tensor, u: Tensor) -> Tensor:
        found = slope(x, y, u)
        found = found - (found @ u) * u
        return unit(found) if found.norm() > 1e-12 else u

    mistakes = {
        "the direction is right; divide by the norm": (slope, lambda x, y, u: 2 * slope(x, y, u) / len(x)),
        "this is the part at a right angle to the direction; keep the whole gradient": tangent,
        "this goes downhill: change the sign": lambda x, y, u: -unit(slope(x, y, u)),
        "points are paired in their original order; pair them by their order along the direction": (
            lambda x, y, u: unit((x - y).T @ ((x - y) @ u))
        ),
        "this is the mean difference of the pairs; each pair counts in proportion to its projected difference": (
            lambda x, y, u: unit((x - y).mean(dim=0))
        ),
    }
    return Exercise(lambda x, y, u: unit(slope(x, y, u)), _three_pairs(1), mistakes)
