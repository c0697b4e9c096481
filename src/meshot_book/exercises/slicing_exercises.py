"""Chapter 03: sliced Wasserstein from scratch, how many lines it takes, and pairs that no line of a set tells apart."""

import math

import numpy as np
import torch

from meshot.types import Float, Tensor
from meshot_book.exercises.verdict import Case, Mistake, as_points, check_answer

AGREE, DIFFER = 1e-9, 1e-3


def sliced_cost(function: object) -> None:
    """Check ``function(points, target, directions)``: SW₂² of equally many points of equal mass over given lines."""
    mistakes = [
        Mistake(
            lambda x, y, u: (u @ x.T - u @ y.T).square().mean(),
            "points are paired in their original order; sort both sides on every line",
        ),
        Mistake(
            lambda x, y, u: ((u @ x.T).sort(dim=0).values - (u @ y.T).sort(dim=0).values).square().mean(),
            "sorted across the lines, not along each one: check the axis of the sort",
        ),
        Mistake(
            lambda x, y, u: (u @ x.sort(dim=0).values.T - u @ y.sort(dim=0).values.T).square().mean(),
            "the coordinates are sorted before projecting, which mixes the points: project first",
        ),
        Mistake(lambda x, y, u: len(x) * _sliced(x, y, u), "a sum over the points; every point carries mass 1/n"),
        Mistake(lambda x, y, u: len(u) * _sliced(x, y, u), "a sum over the lines; the loss is their mean"),
        Mistake(lambda x, y, u: _sliced(x, y, u).sqrt(), "this is SW₂; the loss is its square: leave the root out"),
        Mistake(lambda x, y, u: _gaps(x, y, u).abs().mean(), "distances are not squared: this is SW₁"),
        Mistake(
            lambda x, y, u: _gaps(x, y, u).square().mean(dim=1).sqrt().mean(),
            "a root is taken on every line before the mean; average the squares",
        ),
    ]
    generator = np.random.default_rng(0)
    x, y = (torch.from_numpy(generator.normal(size=(8, 3)) + shift) for shift in (0, 0.7))
    u = torch.nn.functional.normalize(torch.from_numpy(generator.normal(size=(5, 3))), dim=1)
    cases = [
        Case("8 points in R³ and 5 lines", (x, y, u)),
        Case("the same points in another order", (x, x.flip(0), u)),
        Case("one point on either side", (x[:1], y[:1], u)),
        Case("one line", (x, y, u[:1])),
        Case("points in R²", (x[:, :2], y[:, :2], torch.eye(2, dtype=torch.float64))),
        Case("points that project to the same place", (x[[0, 0, 1]], y[[2, 2, 2]], u)),
    ]
    check_answer(function, _sliced, cases, mistakes, "sliced_cost")


def _gaps(points: Float[Tensor, "n d"], target: Float[Tensor, "n d"], directions: Float[Tensor, "L d"]) -> Tensor:
    return (directions @ points.T).sort(dim=1).values - (directions @ target.T).sort(dim=1).values


def _sliced(points: Float[Tensor, "n d"], target: Float[Tensor, "n d"], directions: Float[Tensor, "L d"]) -> Tensor:
    return _gaps(points, target, directions).square().mean()


def lines_needed(function: object) -> None:
    """Check ``function(costs, relative_error)``: how many random lines, judged by the costs on a few."""
    mistakes = [
        Mistake(
            lambda c, e: math.ceil(float(c.std() / c.mean() / math.sqrt(len(c)) / e) ** 2),
            "this divides by the number of trial lines as well: use the deviation of one line, not of the mean",
        ),
        Mistake(
            lambda c, e: math.ceil(float(c.std() / c.mean() / e)),
            "the error falls with the root of the number of lines: something is not squared",
        ),
        Mistake(
            lambda c, e: math.ceil((float(c.std()) / e) ** 2),
            "that is for an absolute error; a relative one is a share of the mean",
        ),
        Mistake(
            lambda c, e: math.ceil(round((float(c.std(correction=0) / c.mean()) / e) ** 2, 9)),
            "the variance is biased: with the mean taken from the same lines, divide by their number less one",
        ),
        Mistake(
            lambda c, e: math.ceil(float(c.sqrt().std() / c.sqrt().mean() / e) ** 2),
            "the mean is over the costs themselves; take no roots",
        ),
        Mistake(
            lambda c, e: math.floor((float(c.std() / c.mean()) / e) ** 2),
            "rounded down, which is one line short: round up",
        ),
        Mistake(lambda c, e: (float(c.std() / c.mean()) / e) ** 2, "the number of lines must be whole: round up"),
    ]
    generator = np.random.default_rng(1)
    costs = torch.from_numpy(generator.chisquare(1, size=12))
    cases = [
        Case("12 lines and 10 %", (costs, 0.1)),
        Case("12 lines and 1 %", (costs, 0.01)),
        Case("costs a hundred times larger", (100 * costs, 0.1)),
        Case("three lines", (costs[:3], 0.05)),
        Case("30 lines", (torch.from_numpy(generator.chisquare(1, size=30)), 0.02)),
    ]
    check_answer(function, _lines, cases, mistakes, "lines_needed")


def _lines(costs: Float[Tensor, " L"], relative_error: float) -> int:
    return math.ceil((float(costs.std() / costs.mean()) / relative_error) ** 2)


def ghost_pair(function: object) -> None:
    """Check ``function(directions)``: two different sets of points with the same projection on every line."""
    mistakes = [
        Mistake(lambda u: _pattern(1, 1, 0), "both sets are equal; two different sets are needed"),
        Mistake(lambda u: _pattern(1, 0, 1), "there must be equally many points in both sets"),
        Mistake(
            lambda u: _pattern(0, 1, 1),
            "their projections differ on one of the lines; shift perpendicular to that line",
        ),
        Mistake(
            lambda u: _pattern(0 if len(u) > 1 else 1, 1, 1),
            "right for one line only: for the next line shift both sets perpendicular to it, then exchange the copies",
        ),
    ]
    generator = np.random.default_rng(2)
    angles = [torch.from_numpy(generator.uniform(0, np.pi, size=n)) for n in (1, 2, 3, 5)]
    lines = [torch.stack([angle.cos(), angle.sin()], dim=1) for angle in angles]
    names = ("one line", "two lines", "three lines", "five lines")
    cases = [Case(name, (line,)) for name, line in zip(names, lines, strict=True)]
    cases += [Case("the two axes", (torch.eye(2, dtype=torch.float64),))]
    tried = function if not callable(function) else lambda directions: _looked_at(function(directions), directions)
    check_answer(tried, lambda directions: _pattern(1, 1, 1), cases, mistakes, "ghost_pair")


def _pattern(agree: float, equally_many: float, differ: float) -> Tensor:
    return torch.tensor([agree, equally_many, differ], dtype=torch.float64)


def _looked_at(answer: object, directions: Float[Tensor, "L 2"]) -> Tensor | None:
    """Whether the sets agree on the lines, are equally many, and differ on others."""
    if answer is None:
        return None
    if not isinstance(answer, tuple | list) or len(answer) != 2:
        raise ValueError("two sets of points are needed: return first, second")
    first, second = (as_points(points) for points in answer)
    if first.ndim != 2 or first.shape[1] != 2 or second.ndim != 2 or second.shape[1] != 2:
        raise ValueError(f"(n, 2) points are needed, and the shapes are {tuple(first.shape)}, {tuple(second.shape)}")
    if len(first) != len(second):
        return _pattern(1, 0, 1)
    angles = torch.arange(90, dtype=torch.float64) * math.pi / 90
    others = torch.stack([angles.cos(), angles.sin()], dim=1)
    scale = float(torch.cat([first, second]).abs().max()) ** 2 + 1e-12
    agree = float(_sliced(first, second, directions.double())) < AGREE * scale
    return _pattern(agree, 1, float(_sliced(first, second, others)) > DIFFER**2 * scale)
