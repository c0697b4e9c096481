"""Chapter 04: a blur's unit, what flipped normals weigh, a debiased cost, and a trap for Chamfer."""

from collections.abc import Callable

import numpy as np
import torch

from meshot.loss import chamfer, wasserstein
from meshot.measure import DiscreteMeasure
from meshot.types import Float, Tensor
from meshot_book.exercises.verdict import Case, Mistake, as_points, check_answer
from meshot_book.flows import forces


def blur_in_coordinates(function: object) -> None:
    """Check ``function(blur_mm, half_extent_mm, p)``: blur and ε = blur^p once ±half_extent_mm has become ±1."""
    mistakes = [
        Mistake(
            lambda b, r, p: (b * r, (b * r) ** p),
            "multiplied instead of divided: coordinates are mm over the half extent",
        ),
        Mistake(lambda b, r, p: (b / (2 * r), (b / (2 * r)) ** p), "[-1, 1] is two units wide: one unit is the *half*"),
        Mistake(lambda b, r, p: (b / r, b**p), "the blur is right; ε must be in coordinates too, not in mm"),
        Mistake(lambda b, r, p: (b / r, b**p / r), "ε carries p powers of the length, so it is divided p times"),
        Mistake(lambda b, r, p: (b / r, b / r), "the blur is right; ε is a cost, the blur to the power p"),
        Mistake(lambda b, r, p: (b, b**p), "unchanged: right only if the half extent is 1 mm"),
    ]
    given = [(5.0, 100.0, 2), (5.0, 100.0, 1), (1.0, 90.0, 2), (0.3, 40.0, 1), (20.0, 10.0, 2)]
    cases = [Case(f"{b} mm in a box of ±{r} mm, p = {p}", (b, r, p)) for b, r, p in given]
    check_answer(function, lambda b, r, p: (b / r, (b / r) ** p), cases, mistakes, "blur_in_coordinates")


def smallest_flip(function: object) -> None:
    """Check ``function(floor_mm, normal_scale_mm)``: the share of a surface whose flipped normals reach the floor."""
    mistakes = [
        Mistake(
            lambda f, s: f**2 / (4 * s**2), "a share cannot exceed 1: return 1 if even the whole surface is too little"
        ),
        Mistake(lambda f, s: min(1.0, f / (2 * s)), "the cost is a *squared* distance times the share; f is a root"),
        Mistake(lambda f, s: min(1.0, f**2 / s**2), "a reversed unit normal moves by twice its length"),
        Mistake(lambda f, s: min(1.0, f**2 / (2 * s**2)), "the square of 2 s is 4 s², not 2 s²"),
        Mistake(
            lambda f, s: min(1.0, 4 * s**2 / f**2), "the quotient is inverted: a larger scale detects *smaller* flips"
        ),
        Mistake(lambda f, s: f, "this is the floor, a length in mm; a share has no unit"),
    ]
    given = [(1.0, 10.0), (6.0, 10.0), (2.0, 1.0), (0.5, 3.0), (10.0, 87.0), (2.0, 0.5)]
    cases = [Case(f"a floor of {f} mm and a normal scale of {s} mm", (f, s)) for f, s in given]
    check_answer(function, lambda f, s: min(1.0, f**2 / (4 * s**2)), cases, mistakes, "smallest_flip")


def debiased(function: object) -> None:
    """Check ``function(entropic, x, y, p)``: from a regularised cost ‖x − y‖^p / p to a divergence like W_p^p."""
    mistakes = [
        Mistake(lambda c, x, y, p: c(x, y) - (c(x, x) + c(y, y)) / 2, "debiased; now undo the division by p"),
        Mistake(lambda c, x, y, p: p * c(x, y), "the factor is right; it is not zero for x = y: subtract the bias"),
        Mistake(
            lambda c, x, y, p: c(x, y),
            "this is the regularised cost itself, which is not zero for x = y: subtract the bias",
        ),
        Mistake(
            lambda c, x, y, p: p * (c(x, y) - c(x, x) - c(y, y)), "for x = y this is negative: take *half* of each"
        ),
        Mistake(
            lambda c, x, y, p: p * (c(x, y) - c(x, x)),
            "the answer changes when x and y are exchanged: subtract half of both biases",
        ),
        Mistake(
            lambda c, x, y, p: (c(x, y) - (c(x, x) + c(y, y)) / 2) / p,
            "divided instead of multiplied: the cost was divided by p",
        ),
        Mistake(lambda c, x, y, p: p * c(x, y) - (c(x, x) + c(y, y)) / 2, "the factor p belongs to all three terms"),
    ]
    generator = np.random.default_rng(0)
    x, y = (torch.from_numpy(generator.normal(size=(n, 2))) for n in (5, 7))
    cases = [
        Case("5 and 7 points, p = 2", (_entropic(2), x, y, 2)),
        Case("5 and 7 points, p = 1", (_entropic(1), x, y, 1)),
        Case("a set and itself", (_entropic(2), x, x, 2)),
        Case("a far translation", (_entropic(2), x, x + 9, 2)),
    ]
    check_answer(function, lambda c, x, y, p: p * (c(x, y) - (c(x, x) + c(y, y)) / 2), cases, mistakes, "debiased")


def _entropic(p: int, epsilon: float = 0.5, n_iterations: int = 100) -> Callable[[Tensor, Tensor], float]:
    """The value of OT_ε with cost ‖x − y‖^p / p between equal masses, by Sinkhorn's iteration on potentials."""

    def value(x: Tensor, y: Tensor) -> float:
        cost = torch.cdist(x, y) ** p / p
        f, g = torch.zeros(len(x)).double(), torch.zeros(len(y)).double()
        for _ in range(n_iterations):
            f = epsilon * (np.log(len(y)) - torch.logsumexp((g[None] - cost) / epsilon, dim=1))
            g = epsilon * (np.log(len(x)) - torch.logsumexp((f[:, None] - cost) / epsilon, dim=0))
        return float(f.mean() + g.mean())

    return value


def trap(function: object) -> None:
    """Check ``function(target)``: as many points as the target has, at rest under Chamfer, and yet not the target.

    What is compared is not the points but two properties: whether all of them are at rest under Chamfer, and whether
    exact transport separates them from the target.
    """
    mistakes = [
        Mistake(
            lambda y: torch.tensor([1.0, 0.0]),
            "no point moves, but exact transport is zero as well: these are the target points themselves",
        ),
        Mistake(
            lambda y: torch.tensor([0.0, 1.0]),
            "a point still moves under Chamfer: add the arrows of the target points that select it",
        ),
        Mistake(
            lambda y: torch.tensor([0.0, 0.0]),
            "a point still moves although exact transport is zero: the two conditions contradict each other",
        ),
    ]
    generator = np.random.default_rng(0)
    rectangle = torch.tensor([[0.0, 0], [4, 0], [4, 1], [0, 1]], dtype=torch.float64)
    cases = [
        Case("the corners of a rectangle", (rectangle,)),
        Case("four random points", (torch.from_numpy(generator.normal(size=(4, 2))),)),
        Case("seven random points", (torch.from_numpy(generator.normal(size=(7, 2))),)),
        Case("five points in R³", (torch.from_numpy(generator.normal(size=(5, 3))),)),
    ]

    def tried(target: Tensor) -> Tensor | None:
        points = function(target)
        return None if points is None else _rest_and_distance(points, target)

    check_answer(tried if callable(function) else function, lambda y: torch.tensor([1.0, 1.0]), cases, mistakes, "trap")


def _rest_and_distance(points: object, target: Float[Tensor, "n d"]) -> Float[Tensor, " 2"]:
    """One if every point is at rest under Chamfer, and one if W₂ to the target is above zero."""
    points = as_points(points)
    if points.shape != target.shape:
        raise ValueError(
            f"shape {tuple(points.shape)} came, {tuple(target.shape)} is needed: as many points as targets"
        )
    goal = DiscreteMeasure(target)
    force = forces(lambda x: chamfer(DiscreteMeasure(x), goal), points).norm(dim=1).max()
    apart = wasserstein(DiscreteMeasure(points), goal)
    return torch.tensor([float(force) < 1e-6, float(apart) > 1e-6]).double()
