"""Exercises of part II, meshes as measures: truths, cases, and the usual mistakes with their hints."""

import math
from collections.abc import Callable, Sequence

import numpy as np
import torch

from meshot.mesh import (
    Mesh,
    cube,
    face_areas,
    face_barycentres,
    face_normals,
    folded_sphere,
    icosphere,
    signed_volume,
    tetrahedron,
)
from meshot.types import Float, Int64, Tensor
from meshot_book.exercises.given import Distances, LimitedDistances, QuadraticLoss, drawn_curves, unasked
from meshot_book.exercises.verdict import Exercise, exercise

# Chapter 7: weights of faces, the tent of a triangle, and the mean square of a projected surface.


def _areas(vertices: Float[Tensor, "V 3"], faces: Int64[Tensor, "F 3"]) -> Float[Tensor, " F"]:
    return face_areas(Mesh(vertices, faces))


@exercise(stars=1)
def face_weights() -> Exercise:
    """Check ``function(vertices, faces)``: the probability of every face under the uniform law on the surface."""
    folded, box = folded_sphere(1, 1.0, 0.4), cube(2.0)
    stretched = box.vertices * torch.tensor([1.0, 3.0, 0.5], dtype=torch.float64)
    empty = torch.tensor([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 0, 0]], dtype=torch.float64)
    cases = {
        "a tetrahedron": (tetrahedron().vertices, tetrahedron().faces),
        "a box with unequal sides": (stretched, box.faces),
        "a folded surface": (folded.vertices, folded.faces),
        "a face without area": (empty, torch.tensor([[0, 1, 2], [0, 1, 3]])),
    }
    mistakes = {
        "every face has the same mass: the mass must be proportional to the area": (
            lambda v, f: torch.full((len(f),), 1 / len(f), dtype=v.dtype)
        ),
        "these are the areas; a probability measure has total mass one": lambda v, f: _areas(v, f),
        "these are the norms of the cross products: halve, then make them sum to one": lambda v, f: 2 * _areas(v, f),
        "the squares of the areas: the root is missing": lambda v, f: _areas(v, f) ** 2 / (_areas(v, f) ** 2).sum(),
        "divided by the largest area: the weights must sum to one instead": (
            lambda v, f: _areas(v, f) / _areas(v, f).max()
        ),
    }
    return Exercise(lambda v, f: _areas(v, f) / _areas(v, f).sum(), cases, mistakes)


@exercise(stars=2)
def tent_density() -> Exercise:
    """Check ``function(corners, x)``: the density of a uniform triangle, its corners projected, at every x."""

    def tent(
        corners: Float[Tensor, " 3"], x: Float[Tensor, " k"], ordered: bool = True, cut: bool = True
    ) -> Float[Tensor, " k"]:
        low, middle, high = corners.sort().values if ordered else corners
        rising = (x - low) / (middle - low) if middle != low else torch.full_like(x, torch.inf)
        falling = (high - x) / (high - middle) if high != middle else torch.full_like(x, torch.inf)
        heights = torch.minimum(rising, falling) * 2 / (high - low)
        inside = (x >= low) & (x <= high)
        return torch.where(inside, heights, torch.zeros_like(heights)) if cut else heights

    generator = np.random.default_rng(0)
    corners = torch.tensor([0.3, 2.0, -1.0], dtype=torch.float64)
    inside = torch.linspace(-0.97, 1.93, 7, dtype=torch.float64)
    beyond = torch.tensor([-3.0, -1.2, 0.25, 2.2, 9.0], dtype=torch.float64)
    random = torch.from_numpy(generator.normal(size=3))
    cases = {
        "three different numbers": (corners, inside),
        "sorted corners": (corners.sort().values, inside),
        "places outside the triangle": (corners, beyond),
        "random corners": (random, torch.from_numpy(generator.normal(size=9))),
        "two corners at the left end": (
            torch.tensor([0.0, 0.0, 3.0]).double(),
            torch.tensor([-1.0, 0.1, 0.5, 2.0]).double(),  # not at the jump, where a density means nothing
        ),
        "two corners at the right end": (
            torch.tensor([1.0, 4.0, 4.0]).double(),
            torch.tensor([0.5, 2.0, 3.5, 3.9, 5.0]).double(),
        ),
    }
    mistakes = {
        "the area under the density is one half instead of one: double the height": lambda c, x: tent(c, x) / 2,
        "the peak is in the middle of the base; it must be at the middle corner": (
            lambda c, x: tent(torch.stack([c.min(), (c.min() + c.max()) / 2, c.max()]), x)
        ),
        "the corners come in any order: sort them first": lambda c, x: tent(c, x, ordered=False),
        "this is the constant density of an edge; that of a triangle rises and falls linearly": (
            lambda c, x: ((x >= c.min()) & (x <= c.max())).double() / (c.max() - c.min())
        ),
        "outside the triangle the density is zero; do not extend the lines": lambda c, x: tent(c, x, cut=False),
    }
    return Exercise(tent, cases, mistakes)


@exercise(stars=3)
def mean_square() -> Exercise:
    """Check ``function(vertices, faces, direction)``: the mean of ⟨θ, x⟩² under the uniform distribution on a mesh."""

    def squares(v: Float[Tensor, "V 3"], f: Int64[Tensor, "F 3"], u: Float[Tensor, " 3"]) -> Float[Tensor, " F"]:
        """The mean of the squared projection over each face: (|a|² + |b|² + |c|² + (a + b + c)²) / 12."""
        corners = v[f] @ u
        return (corners.square().sum(dim=1) + corners.sum(dim=1).square()) / 12

    def mean(v: Float[Tensor, "V 3"], f: Int64[Tensor, "F 3"], values: Float[Tensor, " F"]) -> float:
        areas = _areas(v, f)
        return float((areas * values).sum() / areas.sum())

    oblique = torch.tensor([0.36, 0.48, 0.8], dtype=torch.float64)
    folded, box = folded_sphere(1, 1.0, 0.4), cube(2.0)
    shifted = box.vertices * torch.tensor([1.0, 3.0, 0.5], dtype=torch.float64) + 1.0
    one, face = torch.from_numpy(np.random.default_rng(0).normal(size=(3, 3))), torch.tensor([[0, 1, 2]])
    cases = {
        "one triangle": (one, face, oblique),
        "a shifted box with unequal sides": (shifted, box.faces, oblique),
        "a folded surface": (folded.vertices, folded.faces, oblique),
        "a face seen edge-on": (one, face, face_normals(Mesh(one, face))[0]),
    }
    mistakes = {
        "barycentres only: within a face the projection varies, and that adds to the mean square": (
            lambda v, f, u: mean(v, f, (v[f] @ u).mean(dim=1) ** 2)
        ),
        "corners only: this gives too much weight to points far from the middle": (
            lambda v, f, u: mean(v, f, (v[f] @ u).square().mean(dim=1))
        ),
        "every face has the same weight: weight each by its area": lambda v, f, u: float(squares(v, f, u).mean()),
        "this is the integral; divide by the total area": (
            lambda v, f, u: float((_areas(v, f) * squares(v, f, u)).sum())
        ),
        "this is a root; the mean square is asked for": lambda v, f, u: mean(v, f, squares(v, f, u)) ** 0.5,
        "this is the variance; do not subtract the square of the mean": (
            lambda v, f, u: mean(v, f, squares(v, f, u)) - mean(v, f, (v[f] @ u).mean(dim=1)) ** 2
        ),
        "this is a mean over the vertices; a surface has its mass on its faces": (
            lambda v, f, u: float((v @ u).square().mean())
        ),
    }
    return Exercise(lambda v, f, u: mean(v, f, squares(v, f, u)), cases, mistakes)


# Chapter 8: how many points a bound asks for, the curve that lies about its exponent, and a gap without a bound.


@exercise(stars=1)
def points_needed() -> Exercise:
    """Check ``function(p, joint, first, second, tolerance)``: the least m at which the sharper bound is that low."""

    def root(p: float, joint: float, first: float, second: float, tolerance: float) -> float:
        return p * joint ** (p - 1) * (first + second) / (2 * tolerance)

    def least(p: float, joint: float, first: float, second: float, tolerance: float) -> int:
        return math.ceil(root(p, joint, first, second, tolerance) ** 2)

    cases = {
        "spheres, p = 1": (1, 100.0, 80.0, 76.0, 1.0),
        "spheres far apart, p = 2": (2, 1078.0, 80.0, 76.0, 500.0),
        "concentric spheres": (2, 80.0, 80.0, 76.0, 100.0),
        "p = 3": (3, 5.0, 2.0, 3.5, 7.0),
        "a small pair": (2, 3.0, 1.0, 2.0, 0.3),
        "an exact root": (1, 9.0, 1.0, 1.0, 0.25),
    }
    mistakes = {
        "the bound falls with the root of m: solve for √m, then square": lambda *a: math.ceil(root(*a)),
        "this is no whole number of points: round it up": lambda *a: root(*a) ** 2,
        "rounded down, the bound is just above the tolerance": lambda *a: math.floor(root(*a) ** 2),
        "the joint diameter enters with the power p − 1, as in the derivative of |a|^p": (
            lambda p, joint, *rest: math.ceil((joint * root(p, joint, *rest)) ** 2)
        ),
        "the factor p, from the derivative of |a|^p, is missing": (
            lambda p, *rest: math.ceil((root(p, *rest) / p) ** 2)
        ),
        "four times too many: √(F(1 − F)) is at most ½": lambda *a: math.ceil(4 * root(*a) ** 2),
        "each surface enters with its own diameter; only the derivative of |a|^p uses the joint diameter": (
            lambda p, joint, first, second, tolerance: least(p, joint, joint, joint, tolerance)
        ),
        "the distance between the supports is missing: the derivative of |a|^p uses the joint diameter": (
            lambda p, joint, first, second, tolerance: least(p, max(first, second), first, second, tolerance)
        ),
    }
    return Exercise(least, cases, mistakes)


@exercise(stars=2)
def wrong_curve() -> Exercise:
    """Check ``function(x, errors, claimed)``: which curve does not have the exponent that its legend claims."""

    def fits(x: Tensor, errors: Tensor) -> Tensor:
        gaps = x.log() - x.log().mean()
        return (errors.log() * gaps).sum(dim=1) / gaps.square().sum()

    def farthest(x: Tensor, errors: Tensor, claimed: Tensor) -> int:
        return int((fits(x, errors) - claimed).abs().argmax())

    cases = {f"plot {seed + 1}": drawn_curves(seed) for seed in range(12)}
    cases |= {f"plot {seed + 1}, two points off the line": drawn_curves(seed, 1.5) for seed in (19, 24, 25, 44)}
    mistakes = {
        "the slope from the first to the last point uses two errors of six; fit a line to all points": (
            lambda x, e, c: int(((e[:, -1] / e[:, 0]).log() / (x[-1] / x[0]).log() - c).abs().argmax())
        ),
        "the slope through two points is no better than these two; fit a line to all points": (
            lambda x, e, c: int(((e[:, 1] / e[:, 0]).log() / (x[1] / x[0]).log() - c).abs().argmax())
        ),
        "that is the highest curve; compare slopes, since a constant factor does not change them": (
            lambda x, e, c: int(e[:, 0].argmax())
        ),
        "that is the curve with the largest last error; compare slopes instead": lambda x, e, c: int(e[:, -1].argmax()),
        "that is the steepest curve; compare its slope with the slope that is claimed for it": (
            lambda x, e, c: int(fits(x, e).argmin())
        ),
        "that is the flattest curve; compare its slope with the slope that is claimed for it": (
            lambda x, e, c: int(fits(x, e).argmax())
        ),
        "that is the curve with the flattest claimed slope; compare each claim with its points": (
            lambda x, e, c: int(c.argmax())
        ),
        "that is always the steepest claim: take logarithms of sizes and errors, and check the signs": (
            lambda x, e, c: int(c.argmin())
        ),
        "a curve can also fall faster than it claims: take the size of the difference": (
            lambda x, e, c: int((fits(x, e) - c).argmax())
        ),
    }
    return Exercise(farthest, cases, mistakes)


@exercise(stars=3)
def mean_gap() -> Exercise:
    """Check ``function(share, n_points)``: E|F_m(y) − F(y)| exactly, where F(y) is the share."""

    def gap(share: float, n_points: int) -> float:
        return sum(
            math.comb(n_points, k) * share**k * (1 - share) ** (n_points - k) * abs(k / n_points - share)
            for k in range(n_points + 1)
        )

    pairs = [(0.5, 1), (0.5, 2), (0.25, 10), (0.9, 7), (0.01, 100), (0.5, 500), (0.0, 5), (1.0, 5)]
    cases = {f"F(y) = {share} and {m} points": (share, m) for share, m in pairs}
    mistakes = {
        "that is the bound, the root of the mean square; not the mean": lambda f, m: math.sqrt(f * (1 - f) / m),
        "that is the limit for many points; for few, sum over the binomial distribution": (
            lambda f, m: math.sqrt(2 / math.pi * f * (1 - f) / m)
        ),
        "that is the gap of the number of points below y; F_m divides it by m": lambda f, m: m * gap(f, m),
        "signed gaps cancel: take their absolute values before the sum": lambda f, m: 0.0,
        "that is the variance of F_m(y)": lambda f, m: f * (1 - f) / m,
    }
    return Exercise(gap, cases, mistakes)


# Chapter 9: cells of a merge, exponents from a table, and nearest neighbours in bounded memory.


@exercise(stars=1)
def merged_cells() -> Exercise:
    """Check ``function(masses, others)``: on how many cells of the merged quantile functions both are constant.

    Masses are whole numbers with the same total on both sides, so that jumps at one place are exactly so.
    """

    def ends(masses: Sequence[int]) -> set[int]:
        return {int(end) for end in np.cumsum(masses)}

    def n_cells(masses: Sequence[int], others: Sequence[int]) -> int:
        return len(ends(masses) | ends(others))

    cases = {
        "three steps and two": ([1, 1, 1], [1, 2]),
        "four equal steps on both sides": ([2, 2, 2, 2], [2, 2, 2, 2]),
        "ends that coincide only at the total mass": ([3, 4], [2, 3, 2]),
        "one step and five": ([10], [1, 2, 3, 2, 2]),
        "one step each": ([7], [7]),
        "six steps and four": ([1, 5, 2, 2, 4, 6], [6, 3, 1, 10]),
        "the same masses in another order": ([1, 2, 3, 4], [4, 3, 2, 1]),
    }
    mistakes = {
        "the last steps of both sides end at the same place: count it once": lambda a, b: len(a) + len(b),
        "right unless both sides end a step at the same place; such a place is one end, not two": (
            lambda a, b: len(a) + len(b) - 1
        ),
        "a merge visits every step once; it does not compare all pairs": lambda a, b: len(a) * len(b),
        "that would need every end of the shorter side to be one of the longer": lambda a, b: max(len(a), len(b)),
        "these are the places where both end; count where either does": lambda a, b: len(ends(a) & ends(b)),
        "places where steps of both sides end are missing: they end a cell too": lambda a, b: len(ends(a) ^ ends(b)),
        "the masses are lengths of steps; add them up to get where steps end": lambda a, b: len(set(a) | set(b)),
        "one too many: zero begins the first cell and ends none": lambda a, b: n_cells(a, b) + 1,
    }
    return Exercise(n_cells, cases, mistakes)


@exercise(stars=2)
def growth_exponent() -> Exercise:
    """Check ``function(sizes, seconds)``: the exponent of a power law, by least squares on logarithms."""

    def exponent(sizes: Sequence[float], seconds: Sequence[float]) -> float:
        return float(np.polyfit(np.log(sizes), np.log(seconds), 1)[0])

    noise = np.exp(0.2 * np.random.default_rng(0).standard_normal(5))
    sizes = np.array([1e3, 3e3, 1e4, 3e4, 1e5])
    tables = {
        "a quadratic table": (sizes, 4e-9 * sizes**2),
        "a linear table": (sizes[:3], 5e-6 * sizes[:3]),
        "a table with noise": (sizes, 1e-7 * sizes**1.3 * noise),
        "m log m": (sizes, 1e-7 * sizes * np.log(sizes)),
        "two rows": (sizes[1:3], np.array([0.5, 0.7])),
    }
    cases = {name: tuple(column.tolist() for column in columns) for name, columns in tables.items()}
    mistakes = {
        "the quotient is inverted: the slope is of log seconds over log sizes": lambda m, s: 1 / exponent(m, s),
        "this is the slope of seconds over sizes; take logarithms": lambda m, s: float(np.polyfit(m, s, 1)[0]),
        "the sizes need a logarithm too": lambda m, s: float(np.polyfit(m, np.log(s), 1)[0]),
        "the seconds need a logarithm too": lambda m, s: float(np.polyfit(np.log(m), s, 1)[0]),
        "that is the line through the first and the last row; use all of them (least squares)": (
            lambda m, s: float(np.log(s[-1] / s[0]) / np.log(m[-1] / m[0]))
        ),
        "the power law has a constant factor: fit an intercept as well as a slope": (
            lambda m, s: float((np.log(m) * np.log(s)).sum() / (np.log(m) ** 2).sum())
        ),
        "this is the factor in front of the power; the exponent is the other coefficient": (
            lambda m, s: float(np.exp(np.polyfit(np.log(m), np.log(s), 1)[1]))
        ),
    }
    return Exercise(exponent, cases, mistakes)


@exercise(stars=3)
def blocked_chamfer() -> Exercise:
    """Check ``function(points, targets, distances, limit)``: Chamfer with at most ``limit`` distances at once.

    ``distances(points, targets)`` returns squared distances, and refuses to make more than it is allowed.
    """

    def nearest(points: Float[Tensor, "n d"], targets: Float[Tensor, "m d"]) -> Float[Tensor, " n"]:
        return (points[:, None] - targets[None]).square().sum(dim=2).min(dim=1).values

    def mean_nearest(points: Tensor, targets: Tensor) -> float:
        return float(nearest(points, targets).mean())

    def root_nearest(points: Tensor, targets: Tensor) -> float:
        return float(nearest(points, targets).sqrt().mean())

    def whole_blocks(points: Tensor, targets: Tensor, limit: int) -> float:
        rows = max(1, limit // len(targets))
        return float(nearest(points, targets)[: len(points) // rows * rows].sum() / len(points))

    def mean_of_blocks(points: Tensor, targets: Tensor, limit: int) -> float:
        blocks = nearest(points, targets).split(max(1, limit // len(targets)))
        return float(torch.stack([block.mean() for block in blocks]).mean())

    generator = np.random.default_rng(2)
    x, y = (torch.from_numpy(generator.normal(size=(n, 3))) for n in (11, 7))
    cases = {
        "11 points, 7 targets, 28 distances at once": (x, y, LimitedDistances(28), 28),
        "7 points, 11 targets, 23 distances at once": (y, x, LimitedDistances(23), 23),
        "room for everything": (x, y, LimitedDistances(77), 77),
        "room for one row": (x, y, LimitedDistances(11), 11),
        "one point and one target": (x[:1], y[:1], LimitedDistances(1), 1),
        "points in the plane": (x[:, :2].clone(), y[:, :2].clone(), LimitedDistances(30), 30),
    }
    mistakes = {
        "one direction only: add that from the targets to the points": lambda x, y, s, k: mean_nearest(x, y),
        "one direction only: add that from the points to the targets": lambda x, y, s, k: mean_nearest(y, x),
        "these are sums; the loss takes the mean of either side": (
            lambda x, y, s, k: len(x) * mean_nearest(x, y) + len(y) * mean_nearest(y, x)
        ),
        "one mean over both sides; the loss adds two means, each over its own side": (
            lambda x, y, s, k: (len(x) * mean_nearest(x, y) + len(y) * mean_nearest(y, x)) / (len(x) + len(y))
        ),
        "the last block, which is not full, is left out": (
            lambda x, y, s, k: whole_blocks(x, y, k) + whole_blocks(y, x, k)
        ),
        "a mean of the blocks' means: the blocks have different lengths; add up all distances and divide once": (
            lambda x, y, s, k: mean_of_blocks(x, y, k) + mean_of_blocks(y, x, k)
        ),
        "the loss uses squared distances: take no root": lambda x, y, s, k: root_nearest(x, y) + root_nearest(y, x),
    }

    def chamfer(x: Tensor, y: Tensor, distances: Distances, limit: int) -> float:
        total, best = 0.0, torch.full((len(y),), torch.inf, dtype=y.dtype)
        for block in x.split(max(1, limit // len(y))):
            squares = distances(block, y)
            total += float(squares.min(dim=1).values.sum())
            best = torch.minimum(best, squares.min(dim=0).values)
        return total / len(x) + float(best.mean())

    return Exercise(chamfer, cases, mistakes, way=unasked)


# Chapter 10: the floor of Chamfer, a sliced loss whose mean part is known, and the price of a gap.


@exercise(stars=1)
def chamfer_floor() -> Exercise:
    """Check ``function(area, m, n)``: Chamfer between two samples of one surface of that area, to leading order."""

    def floor(area: float, m: int, n: int) -> float:
        return area / (math.pi * m) + area / (math.pi * n)

    cases = {
        "equal samples of the unit sphere": (4 * math.pi, 100, 100),
        "ten times as many on one side": (20_000.0, 1000, 10_000),
        "a few points": (3.0, 7, 5),
    }
    mistakes = {
        "both means use m: the second sample has n points": lambda a, m, n: 2 * a / (math.pi * m),
        "both means use n: the first sample has m points": lambda a, m, n: 2 * a / (math.pi * n),
        "add the two means, each with its own number of points": lambda a, m, n: 2 * a / (math.pi * (m + n)),
        "the two means are added, not averaged": lambda a, m, n: floor(a, m, n) / 2,
        "a / m is the area for each point; the disc around it has π times r²": lambda a, m, n: a / m + a / n,
        "these are distances; Chamfer takes their squares": (
            lambda a, m, n: math.sqrt(a / (math.pi * m)) + math.sqrt(a / (math.pi * n))
        ),
        "one of the two means is missing": (lambda a, m, n: a / (math.pi * n), lambda a, m, n: a / (math.pi * m)),
    }
    return Exercise(floor, cases, mistakes)


@exercise(stars=2)
def centred_cost() -> Exercise:
    """Check ``function(source, target, directions)``: SW₂² with the mean part taken exactly, the rest estimated."""

    def sliced(x: Float[Tensor, "m d"], y: Float[Tensor, "m d"], u: Float[Tensor, "L d"]) -> float:
        first, second = ((points @ u.T).sort(dim=0).values for points in (x, y))
        return float((first - second).square().mean())

    def shape(x: Float[Tensor, "m d"], y: Float[Tensor, "m d"], u: Float[Tensor, "L d"]) -> float:
        return sliced(x - x.mean(dim=0), y - y.mean(dim=0), u)

    def unsorted(x: Float[Tensor, "m d"], y: Float[Tensor, "m d"], u: Float[Tensor, "L d"]) -> float:
        gaps = (x - x.mean(dim=0) - y + y.mean(dim=0)) @ u.T
        return float(gaps.square().mean())

    def apart(x: Float[Tensor, "m d"], y: Float[Tensor, "m d"]) -> float:
        return float((x.mean(dim=0) - y.mean(dim=0)).square().sum())

    def centred(x: Float[Tensor, "m d"], y: Float[Tensor, "m d"], u: Float[Tensor, "L d"]) -> float:
        return apart(x, y) / x.shape[1] + shape(x, y, u)

    generator = np.random.default_rng(0)

    def cloud(m: int, d: int, shift: float) -> Tensor:
        return torch.from_numpy(shift + generator.normal(size=(m, d)))

    def directions(n: int, d: int) -> Tensor:
        return torch.nn.functional.normalize(cloud(n, d, 0.0))

    cases = {
        "two clouds in space": (cloud(9, 3, 0.0), cloud(9, 3, 2.0), directions(4, 3)),
        "two clouds with normals": (cloud(12, 6, 0.0), cloud(12, 6, -1.0), directions(7, 6)),
        "two clouds in the plane": (cloud(5, 2, 1.0), cloud(5, 2, 1.5), directions(3, 2)),
        "one direction": (cloud(8, 3, 0.0), cloud(8, 3, 5.0), directions(1, 3)),
    }
    mistakes = {
        "this is the plain estimate: the mean part still depends on the directions": sliced,
        "the mean part is missing: add the mean of ⟨θ, t⟩² over the sphere": shape,
        "the mean of ⟨θ, t⟩² over the sphere is not |t|²: each of the d coordinates of θ has the mean square 1/d": (
            lambda x, y, u: apart(x, y) + shape(x, y, u)
        ),
        "the mean part is divided by 3 in every space: use the number of columns": (
            lambda x, y, u: apart(x, y) / 3 + shape(x, y, u)
        ),
        "the mean part is counted twice: centre both clouds before the projection": (
            lambda x, y, u: apart(x, y) / x.shape[1] + sliced(x, y, u)
        ),
        "points are paired in their original order: sort both sides along every direction": (
            lambda x, y, u: apart(x, y) / x.shape[1] + unsorted(x, y, u)
        ),
        "the squared differences are added over the points; each point has the mass 1/m": (
            lambda x, y, u: apart(x, y) / x.shape[1] + x.shape[0] * shape(x, y, u)
        ),
        "SW₂² is asked for: no root": lambda x, y, u: centred(x, y, u) ** 0.5,
    }
    return Exercise(centred, cases, mistakes)


@exercise(stars=3)
def gap_cost() -> Exercise:
    """Check ``function(a, gap, m, p)``: E W_p^p between two samples of two points that are a gap apart, exactly."""

    def binomial(a: float, m: int) -> list[float]:
        return [math.comb(m, k) * a**k * (1 - a) ** (m - k) for k in range(m + 1)]

    def one_sided(a: float, m: int) -> float:
        return sum(chance * abs(k / m - a) for k, chance in enumerate(binomial(a, m)))

    def surplus(a: float, m: int) -> float:
        """E|k − l|/m for two independent binomial numbers."""
        chances = binomial(a, m)
        return sum(p * q * abs(k - n) for k, p in enumerate(chances) for n, q in enumerate(chances)) / m

    def cost(a: float, gap: float, m: int, p: float) -> float:
        return gap**p * surplus(a, m)

    cases = {
        "halves, one point each": (0.5, 2.0, 1, 2),
        "halves, ten points": (0.5, 3.0, 10, 1),
        "unequal masses": (0.2, 1.5, 8, 2),
        "p = 3": (0.7, 2.0, 5, 3),
        "all mass at one position": (1.0, 4.0, 6, 2),
    }
    mistakes = {
        "this compares one sample with the measure itself; here both sides are sampled": (
            lambda a, gap, m, p: gap**p * one_sided(a, m)
        ),
        "each point has the mass 1/m": lambda a, gap, m, p: m * cost(a, gap, m, p),
        "each unit of mass that crosses the gap costs the gap to the power p": (
            lambda a, gap, m, p: gap * surplus(a, m)
        ),
        "W_p^p is asked for: no root": lambda a, gap, m, p: cost(a, gap, m, p) ** (1 / p),
        "that is the root of the mean square of the surplus; its mean absolute value is smaller": (
            lambda a, gap, m, p: gap**p * math.sqrt(2 * a * (1 - a) / m)
        ),
        "that is the limit for many points; for few, sum over both binomial distributions": (
            lambda a, gap, m, p: gap**p * math.sqrt(4 * a * (1 - a) / (math.pi * m))
        ),
        "the surplus at one position equals the deficit at the other: count it once": (
            lambda a, gap, m, p: 2 * cost(a, gap, m, p)
        ),
        "signed surpluses cancel: take their absolute values before the sum": lambda a, gap, m, p: 0.0,
    }
    return Exercise(cost, cases, mistakes)


# Chapter 11: a length for the normals, the gradient of an area, and surfaces turned inside out.


@exercise(stars=2)
def scale_for_share() -> Exercise:
    """Check ``function(loss, share)``: the normal scale s with 1 − loss(0)/loss(s) = share."""

    def solved(rising: Callable[[float], float], wanted: float) -> float:
        low, high = 1e-9, 1e9
        for _ in range(200):
            middle = (low * high) ** 0.5
            low, high = (middle, high) if rising(middle) < wanted else (low, middle)
        return high

    def bracketed(rising: Callable[[float], float], wanted: float, high: float) -> float:
        low = 0.0
        for _ in range(200):
            middle = (low + high) / 2
            low, high = (middle, high) if rising(middle) < wanted else (low, middle)
        return high

    cases = {
        "positions 2, normals s², a tenth": (QuadraticLoss(2.0, 1.0), 0.1),
        "positions 0.3, normals 4 s², a half": (QuadraticLoss(0.3, 4.0), 0.5),
        "normals that saturate at large scales": (QuadraticLoss(1.0, 30.0, 0.5), 0.6),
        "lengths in metres": (QuadraticLoss(1e-6, 2.0, 1e-3), 0.25),
        "lengths in micrometres": (QuadraticLoss(4e6, 1.0, 1e5), 0.2),
    }
    mistakes = {
        "this compares what normals add with the loss *without* them; the share is of the whole, loss(s)": (
            lambda loss, share: solved(lambda s: loss(s) / loss(0) - 1, share)
        ),
        "this is the scale at which the positions have that share, not the normals": (
            lambda loss, share: solved(lambda s: 1 - loss(0) / loss(s), 1 - share)
        ),
        "this is the square of the scale": lambda loss, share: solved(lambda s: 1 - loss(0) / loss(s), share) ** 2,
        "this assumes that normals add a multiple of s², which holds for small s only: search numerically": (
            lambda loss, share: (loss(0) * share / ((1 - share) * (loss(1) - loss(0)))) ** 0.5
        ),
        "scales may have any size, and this search ends at 100: widen the interval until it contains the solution": (
            lambda loss, share: bracketed(lambda s: 1 - loss(0) / loss(s), share, 100.0)
        ),
    }
    return Exercise(lambda loss, share: solved(lambda s: 1 - loss(0) / loss(s), share), cases, mistakes)


@exercise(stars=1)
def area_gradient() -> Exercise:
    """Check ``function(a, b, c)``: the gradient of the area of a triangle in its corner a."""

    def gradient(a: Float[Tensor, " 3"], b: Float[Tensor, " 3"], c: Float[Tensor, " 3"]) -> Float[Tensor, " 3"]:
        edge = c - b
        height = a - b - ((a - b) @ edge) / (edge @ edge) * edge
        return height / height.norm() * edge.norm() / 2

    generator = np.random.default_rng(0)
    flat = torch.tensor([[0.0, 2.0, 0.0], [0.0, 0.0, 0.0], [3.0, 0.0, 0.0]], dtype=torch.float64)
    cases = {
        "a right triangle": tuple(flat),
        "the same, clockwise": (flat[0], flat[2], flat[1]),
        "a random triangle": tuple(torch.from_numpy(generator.normal(size=(3, 3)))),
        "another random triangle": tuple(torch.from_numpy(generator.normal(size=(3, 3)))),
    }
    mistakes = {
        "the sign is wrong: the area grows when a moves away from the opposite edge": (
            lambda a, b, c: -gradient(a, b, c)
        ),
        "the area is half of base times height: a factor of two": lambda a, b, c: 2 * gradient(a, b, c),
        "the direction is right; the length must be half that of the opposite edge": (
            lambda a, b, c: gradient(a, b, c) / gradient(a, b, c).norm()
        ),
        "this points away from the middle of the opposite edge; the gradient is perpendicular to the edge": (
            lambda a, b, c: (c - b).norm() * (a - (b + c) / 2) / (a - (b + c) / 2).norm() / 2
        ),
        "this is the gradient in b": lambda a, b, c: gradient(b, c, a),
        "this is the gradient in c": lambda a, b, c: gradient(c, a, b),
        "this is the area vector, which is perpendicular to the triangle; the gradient lies in its plane": (
            lambda a, b, c: torch.linalg.cross(b - a, c - a) / 2
        ),
    }
    return Exercise(gradient, cases, mistakes)


@exercise(stars=3)
def is_inside_out() -> Exercise:
    """Check ``function(vertices, faces)``: do the normals of a closed surface point inwards?"""

    def inside_out(vertices: Float[Tensor, "V 3"], faces: Int64[Tensor, "F 3"]) -> bool:
        return bool(signed_volume(Mesh(vertices, faces)) < 0)

    def radial(
        vertices: Float[Tensor, "V 3"], faces: Int64[Tensor, "F 3"], centred: bool = True
    ) -> Float[Tensor, " F"]:
        """⟨barycentre, normal⟩ of every face, from the mean of the vertices."""
        mesh = Mesh(vertices - vertices.mean(dim=0) if centred else vertices, faces)
        return (face_barycentres(mesh) * face_normals(mesh)).sum(dim=1)

    def notched_block(walls_first: bool) -> Mesh:
        """A cube whose top is a deep funnel, cut into many rings of small faces."""
        vertices, faces = cube(2.0).vertices, cube(2.0).faces
        top = (vertices[:, 2] == 1).nonzero().flatten()
        rim = vertices[top[[0, 2, 3, 1]]]  # counter-clockwise from above
        tip = torch.tensor([0.0, 0.0, -0.9], dtype=torch.float64)
        shrunk = 0.75 ** torch.arange(1, 13, dtype=torch.float64)
        rings = tip + shrunk[:, None, None] * (rim - tip)
        points = torch.cat([vertices, rings.reshape(-1, 3), tip[None]])
        names = torch.cat([top[[0, 2, 3, 1]][None], 8 + torch.arange(4 * len(shrunk)).view(-1, 4)])
        outer, inner = names[:-1], names[1:]
        walls = [(outer, outer.roll(-1, 1), inner), (outer.roll(-1, 1), inner.roll(-1, 1), inner)]
        last = torch.full_like(names[-1], len(points) - 1)
        walls.append((names[-1], names[-1].roll(-1), last))
        cut = torch.cat([torch.stack([side.reshape(-1) for side in wall], dim=1) for wall in walls])
        rest = faces[~(vertices[faces][..., 2] == 1).all(dim=1)]
        return Mesh(points, torch.cat([cut, rest] if walls_first else [rest, cut]))

    sphere, folded = icosphere(1), folded_sphere(2, 1.0, 0.6, 6)
    block, other = notched_block(True), notched_block(False)
    far = sphere.vertices + torch.tensor([5.0, -3.0, 2.0], dtype=torch.float64)
    cases = {
        "a sphere": (sphere.vertices, sphere.faces),
        "a sphere turned inside out": (sphere.vertices, sphere.faces.flip(1)),
        "a sphere far from the origin": (far, sphere.faces),
        "the same, inside out": (far, sphere.faces.flip(1)),
        "a folded surface": (folded.vertices, folded.faces),
        "a block with a funnel of many small faces": (block.vertices, block.faces),
        "the same block, inside out": (block.vertices, block.faces.flip(1)),
        "the same block, its faces in another order": (other.vertices, other.faces),
    }
    mistakes = {
        "the answer is negated: outward normals are the correct ones": lambda v, f: not inside_out(v, f),
        "faces have equal weights here; weight each by its area, or finely divided regions count too much": (
            lambda v, f: bool((radial(v, f)).mean() < 0)
        ),
        "this uses one face only; on a folded surface some outward normals point towards the middle": (
            lambda v, f: bool(radial(v, f)[0] < 0)
        ),
        "some outward normals point towards the origin; only the sum over all faces decides": (
            lambda v, f: bool((radial(v, f, centred=False) * face_areas(Mesh(v, f))).min() < 0)
        ),
    }
    return Exercise(inside_out, cases, mistakes)
