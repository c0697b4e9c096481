"""Exercises of part III, flows: truths, cases, and the usual mistakes with their hints."""

import math

import numpy as np
import scipy.optimize
import torch

from meshot.mesh import Mesh, folded_sphere, icosphere
from meshot.types import Array, Float, Int64, Tensor
from meshot_book.exercises.given import grow, half, hurry, spin, still, wave, whirl
from meshot_book.exercises.verdict import Exercise, exercise

# Chapter 12: a flow by Euler steps, one step undone, and how many steps are safe.


@exercise(stars=1)
def euler_flow() -> Exercise:
    """Check ``function(velocity, points, n_steps)``: the flow on [0, 1] by equal Euler steps."""

    def euler(velocity: object, points: Tensor, n_steps: int, n_taken: int | None = None) -> Tensor:
        for k in range(n_steps if n_taken is None else n_taken):
            points = points + velocity(k / n_steps, points) / n_steps
        return points

    points = torch.from_numpy(np.random.default_rng(0).normal(size=(6, 2)))
    cases = {
        "a rotation in 7 steps": (spin, points, 7),
        "a rotation that speeds up, in 5 steps": (hurry, points, 5),
        "a field that bends, in 4 steps": (grow, points, 4),
        "a single step": (hurry, points, 1),
        "no velocity": (still, points, 3),
        "points on a line": (grow, points[:, :1], 6),
    }
    mistakes = {
        "the time does not advance; step k begins at k / n": lambda v, x, n: euler(lambda t, y: v(0.0, y), x, n),
        "each step uses the velocity at its end; Euler's method uses that at its beginning": (
            lambda v, x, n: euler(lambda t, y: v(t + 1 / n, y), x, n)
        ),
        "every step uses the velocity at the initial positions; use the current positions": (
            lambda v, x, n: x + sum(v(k / n, x) for k in range(n)) / n
        ),
        "the steps have length 1; they are 1 / n long": lambda v, x, n: euler(lambda t, y: n * v(t, y), x, n),
        "one step is missing; count them": lambda v, x, n: euler(v, x, n, n - 1),
        "one step too many; the last one begins at 1 − 1 / n": lambda v, x, n: euler(v, x, n, n + 1),
        "this is a single step of length 1, whatever n_steps says": lambda v, x, n: x + v(0.0, x),
        "the points move against the velocity: the sign is wrong": lambda v, x, n: euler(lambda t, y: -v(t, y), x, n),
    }
    return Exercise(euler, cases, mistakes)


@exercise(stars=2)
def undo_step() -> Exercise:
    """Check ``function(velocity, images, step)``: the points that one Euler step has carried to ``images``."""

    def undone(velocity: object, images: Tensor, step: float, n_rounds: int = 400) -> Tensor:
        points = images
        for _ in range(n_rounds):
            points = images - step * velocity(points)
        return points

    points = torch.from_numpy(np.random.default_rng(1).normal(size=(6, 2)))
    cases = {
        "a whirl, step 0.5": (whirl, points, 0.5),
        "a wave, step 0.9": (wave, points, 0.9),
        "a linear field, step 0.8": (half, points, 0.8),
        "a step of length zero": (wave, points, 0.0),
        "points on a line, step 0.6": (wave, points[:, :1], 0.6),
    }
    mistakes = {
        "this uses the velocity at the image; the step used the velocity at the unknown point: iterate": (
            lambda v, y, h: y - h * v(y)
        ),
        "the iteration is right, but two steps are not enough; repeat until it converges": (
            lambda v, y, h: y - h * v(y - h * v(y))
        ),
        "the iteration is right, but has not converged: at h Λ = .9 every round gains only a factor of .9": tuple(
            lambda v, y, h, n=n: undone(v, y, h, n) for n in (3, 5, 10, 20, 30, 40, 50)
        ),
        "that is one more step forward": lambda v, y, h: y + h * v(y),
        "the sign: x + h v(x) = y, so x = y − …": lambda v, y, h: undone(lambda x: -v(x), y, h),
        "these are the images themselves": lambda v, y, h: y,
    }
    return Exercise(undone, cases, mistakes)


@exercise(stars=2)
def safe_steps() -> Exercise:
    """Check ``function(norms)``: the fewest equal Euler steps on [0, 1] with h·Lip < 1, from local constants."""
    drawn = torch.linspace(0.1, 1.0, 12, dtype=torch.float64).reshape(3, 4)
    cases = {
        "a field that steepens": (7.3 * drawn,),
        "a field that calms down": (12.6 * drawn.flip(0),),
        "a steepest place of exactly 4": (4 * drawn,),
        "a gentle field": (0.8 * drawn,),
        "no velocity": (0 * drawn,),
        "one moment and one point": (torch.tensor([[2.5]], dtype=torch.float64),),
    }
    mistakes = {
        "this uses the average of the constants; every step must be safe for the largest one": (
            lambda norms: math.floor(norms.mean()) + 1
        ),
        "this uses the first time only; the constant may be larger later": lambda norms: math.floor(norms[0].max()) + 1,
        "h·Lip < 1 is strict: if the largest constant is a whole number, one more step is needed": (
            lambda norms: max(1, math.ceil(norms.max()))
        ),
        "that is one too few: h·Lip is still above one": lambda norms: math.floor(norms.max()),
        "a number of steps is whole": lambda norms: norms.max() + 1,
        "the constants are per unit of time already; how many steps were taken to measure them does not matter": (
            lambda norms: math.floor(norms.max() * len(norms)) + 1
        ),
        "this divides by the number of measured steps; the step size h is the unknown": (
            lambda norms: math.floor(norms.max() / len(norms)) + 1
        ),
    }
    return Exercise(lambda norms: math.floor(norms.max()) + 1, cases, mistakes)


# Chapter 14: how even triangles are, who is ahead after equal seconds.


Curves = tuple[Tensor, Tensor, Tensor, Tensor]


@exercise(stars=1)
def edge_variation() -> Exercise:
    """Check ``function(vertices, faces)``: standard deviation over mean of the edge lengths, every edge once."""

    def arrays(mesh: Mesh) -> tuple[Tensor, Tensor]:
        return mesh.vertices, mesh.faces

    def triangles(vertices: list[list[float]], faces: list[list[int]]) -> tuple[Tensor, Tensor]:
        return torch.tensor(vertices, dtype=torch.float64), torch.tensor(faces)

    def sides(faces: Int64[Tensor, "F 3"]) -> Int64[Tensor, "S 2"]:
        return torch.cat([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])

    def _edges(faces: Int64[Tensor, "F 3"]) -> Int64[Tensor, "E 2"]:
        return torch.unique(sides(faces).sort(dim=1).values, dim=0)

    def lengths(vertices: Float[Tensor, "V 3"], edges: Int64[Tensor, "E 2"]) -> Float[Tensor, " E"]:
        return (vertices[edges[:, 0]] - vertices[edges[:, 1]]).norm(dim=1)

    def variation(sizes: Float[Tensor, " n"], unbiased: bool = False) -> Float[Tensor, ""]:
        return sizes.std(unbiased=unbiased) / sizes.mean()

    cases = {
        "a folded sphere": arrays(folded_sphere(1)),
        "the same, ten times as large": arrays(folded_sphere(1, 400.0, 60.0)),
        "an icosahedron, all edges equal": arrays(icosphere(0)),
        "a single triangle with sides 3, 4, 5": triangles([[0, 0, 0], [3, 0, 0], [0, 4, 0]], [[0, 1, 2]]),
        "an open strip": triangles(
            [[0, 0, 0], [1, 0, 0], [0, 2, 0], [1, 3, 1], [0, 5, 0]], [[0, 1, 2], [1, 3, 2], [2, 3, 4]]
        ),
    }
    mistakes = {
        "edges between two faces are counted twice, edges at the boundary once; count every edge once": (
            lambda v, f: variation(lengths(v, sides(f)))
        ),
        "divide by the number of edges n, not by n − 1: the edges are all known, not a sample": (
            lambda v, f: variation(lengths(v, _edges(f)), unbiased=True)
        ),
        "that is the standard deviation, a length; divide by the mean, so that the size of the mesh cancels": (
            lambda v, f: lengths(v, _edges(f)).std(unbiased=False)
        ),
        "that is the square; take the root of the variance": lambda v, f: variation(lengths(v, _edges(f))) ** 2,
        "these are the squared lengths; take roots first": lambda v, f: variation(lengths(v, _edges(f)).square()),
    }
    return Exercise(lambda v, f: variation(lengths(v, _edges(f))), cases, mistakes)


@exercise(stars=3)
def equal_time() -> Exercise:
    """Check ``function(times, values, other_times, other_values)``: both curves when the first of the two is done."""

    def both(times: Tensor, values: Tensor, other_times: Tensor, other_values: Tensor, moment: Tensor) -> Tensor:
        return torch.stack([between(times, values, moment), between(other_times, other_values, moment)])

    def between(times: Tensor, values: Tensor, moment: Tensor) -> Float[Tensor, ""]:
        """The value on the straight line between the checks around a moment; the last one after the end."""
        after = int(torch.searchsorted(times, moment).clamp(1, len(times) - 1))
        part = ((moment - times[after - 1]) / (times[after] - times[after - 1])).clamp(0, 1)
        return values[after - 1] + part * (values[after] - values[after - 1])

    def held(times: Tensor, values: Tensor, moment: Tensor) -> Float[Tensor, ""]:
        return values[int((times <= moment).sum()) - 1]

    def curve(*numbers: float) -> Float[Tensor, " n"]:
        return torch.tensor(numbers, dtype=torch.float64)

    slow, quick = (curve(0, 10, 20, 30), curve(4, 2, 1, 0.6)), (curve(0, 3, 6, 9, 12), curve(4, 3, 2.5, 2, 1.8))
    cases = {
        "a slow and a fast run": (*slow, *quick),
        "a fast and a slow run": (*quick, *slow),
        "a run whose error increases in between": (*slow, curve(0, 4, 8, 16), curve(3, 1, 2, 1.5)),
        "two runs that end together": (*quick, curve(0, 12), curve(5, 1)),
        "a run that ends at a check of the other": (curve(0, 10), curve(2, 1), *slow),
    }
    mistakes = {
        "these are the last values: equal steps, not equal seconds": lambda t, x, s, y: torch.stack([x[-1], y[-1]]),
        "this compares at equal numbers of checks; compare at equal seconds": (
            lambda t, x, s, y: torch.stack([x[min(len(t), len(s)) - 1], y[min(len(t), len(s)) - 1]])
        ),
        "this takes the value of the last check before that time; interpolate linearly between checks": (
            lambda t, x, s, y: torch.stack([held(t, x, min(t[-1], s[-1])), held(s, y, min(t[-1], s[-1]))])
        ),
        "one of the runs ended earlier; compare at the time at which the shorter run ends": (
            lambda t, x, s, y: both(t, x, s, y, (t[-1] + s[-1]) / 2)
        ),
        "the two values are exchanged": lambda t, x, s, y: both(t, x, s, y, min(t[-1], s[-1])).flip(0),
        "the least value is not the value at that time": lambda t, x, s, y: torch.stack([x.min(), y.min()]),
    }
    return Exercise(lambda t, x, s, y: both(t, x, s, y, min(t[-1], s[-1])), cases, mistakes)


# Chapter 13: whether two sides cross, and how fine a mesh must be.


@exercise(stars=1)
def sides_cross() -> Exercise:
    """Check ``function(a, b, c, d)``: whether the sides from a to b and from c to d cross, beyond touching."""

    def side(p: Array, q: Array, r: Array) -> float:
        return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])

    def apart(p: Array, q: Array, r: Array, s: Array) -> bool:
        return bool(side(p, q, r) * side(p, q, s) < 0)

    def boxes_meet(a: Array, b: Array, c: Array, d: Array) -> bool:
        low, high = (np.stack([pick(a, b), pick(c, d)]) for pick in (np.minimum, np.maximum))
        return bool((low.max(axis=0) < high.min(axis=0)).all())

    quadruples = {
        "two diagonals of a square": ((0, 0), (1, 1), (0, 1), (1, 0)),
        "the same, one of them turned round": ((0, 0), (1, 1), (1, 0), (0, 1)),
        "sides far apart": ((0, 0), (1, 0), (3, 2), (4, 5)),
        "parallel sides": ((0, 0), (2, 1), (0, 1), (2, 2)),
        "the line through the first cuts the second, beyond its end": ((0, 0), (1, 0), (3, -1), (2.5, 1)),
        "the line through the second cuts the first, beyond its end": ((3, -1), (2.5, 1), (0, 0), (1, 0)),
        "boxes that overlap, sides that do not cross": ((0, 0), (2, 2), (1, 0), (2, 0.5)),
        "a side that ends on the other": ((0, 0), (2, 0), (1, 0), (1, 1)),
        "a common corner": ((0, 0), (1, 0), (0, 0), (0, 1)),
        "two pieces of one line": ((0, 0), (2, 0), (1, 0), (3, 0)),
    }
    cases = {name: tuple(np.array(point, dtype=float) for point in four) for name, four in quadruples.items()}
    mistakes = {
        "the line through a and b must separate c and d, and the line through c and d must separate a and b: both": (
            lambda a, b, c, d: apart(a, b, c, d),
            lambda a, b, c, d: apart(c, d, a, b),
        ),
        "sides that only touch do not cross: the products must be negative, not zero": (
            lambda a, b, c, d: bool(side(a, b, c) * side(a, b, d) <= 0 and side(c, d, a) * side(c, d, b) <= 0)
        ),
        "boxes around the sides may overlap although the sides do not cross": boxes_meet,
        "one of the two conditions is not enough": lambda a, b, c, d: apart(a, b, c, d) or apart(c, d, a, b),
        "the signs are exchanged: the product is negative if two points lie on different sides": (
            lambda a, b, c, d: bool(side(a, b, c) * side(a, b, d) > 0 and side(c, d, a) * side(c, d, b) > 0)
        ),
    }
    return Exercise(lambda a, b, c, d: apart(a, b, c, d) and apart(c, d, a, b), cases, mistakes)


@exercise(stars=2)
def divisions_needed() -> Exercise:
    """Check ``function(edge, angle, lipschitz, bend, chord_arc)``: divisions until no faces can intersect."""

    def shape(angle: float) -> float:
        return max(2.0, 1 / math.sin(math.radians(angle)))

    def fewest(product: float, base: float = 2.0) -> int:
        k = 0
        while not product < base**k:
            k += 1
        return k

    quintuples = [
        (0.3, 40.0, 2.0, 5.0, 1.6),
        (0.3, 40.0, 0.5, 0.1, 1.6),  # fine enough
        (1.0, 10.0, 1.0, 2.0, 3.0),  # thin triangles
        (4.0, 60.0, 0.0, 1.0, 1.0),  # exactly eight
        (2.0, 35.0, 3.0, 0.0, 2.0),  # an affine flow
        (0.05, 50.0, 8.0, 20.0, 1.6),
        (0.5, 25.0, 4.0, 3.0, 5.0),
    ]
    names = [f"edge {e}, angle {a}°, Λ {v}, B {b}, κ {k}" for e, a, v, b, k in quintuples]
    mistakes = {
        "the inequality is strict: where the product is a power of two, one more division is needed": (
            lambda e, a, v, b, k: (
                0 if e * k * shape(a) * b == 0 else max(0, math.ceil(math.log2(e * k * shape(a) * b * math.exp(v))))
            )
        ),
        "a division halves the edges; it does not divide them by four": (
            lambda e, a, v, b, k: fewest(e * k * shape(a) * b * math.exp(v), 4.0)
        ),
        "c_α is at least 2: the larger of 2 and 1 / sin α": (
            lambda e, a, v, b, k: fewest(e * k / math.sin(math.radians(a)) * b * math.exp(v))
        ),
        "c_α is not always 2: for small angles 1 / sin α is larger": (
            lambda e, a, v, b, k: fewest(e * k * 2 * b * math.exp(v))
        ),
        "the angle is in degrees, and math.sin takes radians": (
            lambda e, a, v, b, k: fewest(e * k * max(2.0, 1 / abs(math.sin(a))) * b * math.exp(v))
        ),
        "the allowed edge is shorter for a stronger field: e^(−Λ) stands on the right, so e^Λ on the left": (
            lambda e, a, v, b, k: fewest(e * k * shape(a) * b * math.exp(-v))
        ),
        "the chord-arc constant κ is missing": lambda e, a, v, b, k: fewest(e * shape(a) * b * math.exp(v)),
        "the bound B of the second derivatives is missing": lambda e, a, v, b, k: fewest(
            e * k * shape(a) * math.exp(v)
        ),
        "a mesh that is fine enough needs no division: 0, not a negative number": (
            lambda e, a, v, b, k: math.floor(math.log2(max(1e-300, e * k * shape(a) * b * math.exp(v)))) + 1
        ),
        "a number of divisions is whole: round it up": (
            lambda e, a, v, b, k: max(0.0, math.log2(max(1e-300, e * k * shape(a) * b * math.exp(v))))
        ),
    }
    return Exercise(
        lambda e, a, v, b, k: fewest(e * k * shape(a) * b * math.exp(v)), dict(zip(names, quintuples)), mistakes
    )


@exercise(stars=3)
def pieces_needed() -> Exercise:
    """Check ``function(length, bend, gap)``: the fewest equal pieces of a side whose chords stay within the gap."""

    def pieces(length: float, bend: float, gap: float) -> int:
        return max(1, math.ceil(length * math.sqrt(bend / (8 * gap))))

    triples = [
        (2.0, 11.0, 0.3),
        (2.0, 0.5, 0.3),
        (5.0, 2.0, 0.011),
        (1.0, 40.0, 0.21),
        (0.1, 1.0, 0.5),
        (3.0, 7.0, 0.05),
        (2.0, 8.0, 1.0),  # exactly two
        (2.0, 0.0, 0.3),  # a straight side
    ]
    cases = {f"length {s}, bend {c}, gap {g}": (s, c, g) for s, c, g in triples}
    mistakes = {
        "the factor is wrong: a chord is farthest from its arc in the middle of the arc": (
            lambda s, c, g: math.ceil(s * math.sqrt(c / 2 / g))
        ),
        "the distance between chord and arc has a factor 1/8": lambda s, c, g: math.ceil(s * math.sqrt(c / g)),
        "that is the distance of one chord over the gap; it falls with the square of the number of pieces": (
            lambda s, c, g: math.ceil(s**2 * c / 8 / g)
        ),
        "rounded down; the pieces are then too long": lambda s, c, g: math.floor(s * math.sqrt(c / 8 / g)),
        "one too many where the number is whole already: round up instead of adding one": (
            lambda s, c, g: math.floor(s * math.sqrt(c / 8 / g)) + 1
        ),
        "a straight side is one piece, not none": lambda s, c, g: math.ceil(s * math.sqrt(c / 8 / g)),
        "a number of pieces is whole: round it up": lambda s, c, g: s * math.sqrt(c / 8 / g),
        "length and curvature are exchanged": lambda s, c, g: math.ceil(c * math.sqrt(s / 8 / g)),
    }
    return Exercise(pieces, cases, mistakes)


# Chapter 15: two points, the weights of a window, partial transport as a linear program.


@exercise(stars=1)
def pair_costs() -> Exercise:
    """Check ``function(gap, reach)``: the partial and the unbalanced cost of two points of mass one on a line."""

    def unbalanced(gap: float, reach: float) -> float:
        return reach * (1 - math.exp(-gap / reach))

    cases = {
        "points that are near": (0.5, 5.0),
        "points at the reach": (5.0, 5.0),
        "points that are far apart": (80.0, 5.0),
        "points in one place": (0.0, 2.0),
        "a reach of one": (1.7, 1.0),
    }
    mistakes = {
        "mass is removed and added for the reach in total, not for the reach on either side": (
            lambda gap, reach: (min(gap, 2 * reach), unbalanced(gap, reach))
        ),
        "the first cost is that of transport; from which distance on is it cheaper to remove and to add the mass?": (
            lambda gap, reach: (gap, unbalanced(gap, reach))
        ),
        "in the second cost the weight of the penalty is half the reach": (
            lambda gap, reach: (min(gap, reach), unbalanced(gap, 2 * reach))
        ),
        "the second cost is largest for points in one place; it should be zero there": (
            lambda gap, reach: (min(gap, reach), reach * math.exp(-gap / reach))
        ),
        "the second cost has no unit; its largest value is the reach": (
            lambda gap, reach: (min(gap, reach), 1 - math.exp(-gap / reach))
        ),
        "the second cost is only the transport of the mass that is left; add the two penalties": (
            lambda gap, reach: (min(gap, reach), gap * math.exp(-gap / reach))
        ),
        "the two costs are exchanged": lambda gap, reach: (unbalanced(gap, reach), min(gap, reach)),
    }
    return Exercise(lambda gap, reach: (min(gap, reach), unbalanced(gap, reach)), cases, mistakes)


@exercise(stars=2)
def window_weights() -> Exercise:
    """Check ``function(points, weights, centre, radius)``: the masses within a window, with sum one."""

    def windowed(
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

    random = np.random.default_rng(0)
    points, weights = torch.from_numpy(random.normal(size=(30, 3))), torch.from_numpy(random.dirichlet(np.ones(30)))
    flat = torch.tensor([[0.0, 0.0], [1.0, 0.0], [2.4, 0.0], [2.6, 0.0]], dtype=torch.float64)
    cases = {
        "points around the centre": (points, weights, torch.zeros(3, dtype=torch.float64), 0.7),
        "a centre aside": (points, weights, points[3], 0.4),
        "points on both sides of the end of a window": (flat, torch.full((4,), 0.25).double(), flat[0], 1.0),
        "a wide window": (points, weights, points[0], 50.0),
    }
    mistakes = {
        "the masses in the window do not sum to one; divide by their sum": lambda *a: windowed(*a, total=False),
        "the window ends at 2.5 radii; beyond, the weights are zero": lambda *a: windowed(*a, cut=math.inf),
        "the window ends at 2.5 radii, not at one": lambda *a: windowed(*a, cut=1.0),
        "the radius is the standard deviation of the Gaussian; divide the squared distance by 2 radius²": (
            lambda *a: windowed(*a, spread=1.0)
        ),
        "within the window the weights decrease, by a Gaussian": lambda *a: windowed(*a, spread=math.inf),
        "the masses of the points are left out; multiply them by the Gaussian": (
            lambda p, w, c, r: windowed(p, torch.ones_like(w), c, r)
        ),
    }
    return Exercise(windowed, cases, mistakes)


@exercise(stars=3)
def partial_cost() -> Exercise:
    """Check ``function(positions, masses, reach)``: the partial cost between the positive and the negative masses."""

    def dual(positions: Float[Array, " n"], masses: Float[Array, " n"], reach: float) -> float:
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

    random = np.random.default_rng(1)

    def drawn(n: int) -> tuple[Array, Array]:
        masses = random.normal(size=n)
        return np.sort(random.normal(size=n) * 5), masses - masses.mean()

    cases = {
        "seven points": (*drawn(7), 2.0),
        "twelve points and a short reach": (*drawn(12), 0.3),
        "a pair beyond the reach, and one within it": (np.array([0.0, 1, 30, 50]), np.array([1.0, -1, 1, -1]), 8.0),
        "a long reach": (*drawn(9), 400.0),
        "positions out of order": (np.array([3.0, 0, 9, 1]), np.array([0.5, -0.2, -0.6, 0.3]), 4.0),
    }
    mistakes = {
        "this is the cost of transport without removal; bound the values of the function, too": (
            lambda z, m, reach: dual(z, m, math.inf)
        ),
        "the function is bounded by half the reach: to remove and to add costs the reach in total": (
            lambda z, m, reach: dual(z, m, 2 * reach)
        ),
        "the bound is half the reach, not a quarter of it": lambda z, m, reach: dual(z, m, reach / 2),
        "this removes all mass; transport is cheaper where both kinds of mass are near": (
            lambda z, m, reach: reach / 2 * np.abs(m).sum()
        ),
        "this transports everything or removes everything; some mass may be removed and the rest transported": (
            lambda z, m, reach: min(dual(z, m, math.inf), reach / 2 * np.abs(m).sum())
        ),
        "the sign is wrong: linprog returns a minimum": lambda z, m, reach: -dual(z, m, reach),
    }
    return Exercise(dual, cases, mistakes)
