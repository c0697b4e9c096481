"""Chapter 01: descent directions of both losses, and the learning rate that momentum allows."""

import numpy as np
import torch

from meshot.types import Float, Tensor
from meshot_book.exercises.verdict import Case, Mistake, check_answer


def nearest_arrows(function: object) -> None:
    """Check ``function(points, target)``: for every point, the vector to the nearest target point."""
    mistakes = [
        Mistake(
            lambda x, y: -_to_nearest(x, y),
            "the arrows point away from the target: subtract the point from the target, not the reverse",
        ),
        Mistake(
            lambda x, y: _nearest(x, y), "these are the nearest target points themselves; an arrow starts at the point"
        ),
        Mistake(
            lambda x, y: y[torch.cdist(x, y).argmin(dim=0)] - x,
            "the smallest is looked for among the points, not among the targets: check the axis of the minimum",
        ),
        Mistake(
            lambda x, y: 2 * _to_nearest(x, y), "twice too long: the arrow is the difference vector, not the gradient"
        ),
        Mistake(_unit_pull, "the directions are right, the lengths are all one: leave out the division by the norm"),
        Mistake(
            lambda x, y: y.mean(dim=0) - x, "every arrow ends at the mean of the target; take the nearest target point"
        ),
    ]
    generator = np.random.default_rng(0)
    x, y = (torch.from_numpy(generator.normal(size=(n, 2))) for n in (7, 7))
    cases = [
        Case("7 points and 7 targets", (x, y)),
        Case("5 points and 9 targets", (x[:5], torch.cat([y, y[:2] + 3]))),
        Case("one point and three targets", (x[:1], y[:3])),
        Case("points that lie on the target already", (y, y)),
        Case("points far from the target", (x + 100, y)),
        Case("points in R³", tuple(torch.from_numpy(generator.normal(size=(n, 3))) for n in (6, 4))),
    ]
    check_answer(function, _to_nearest, cases, mistakes, "nearest_arrows")


def _nearest(points: Float[Tensor, "n d"], target: Float[Tensor, "m d"]) -> Float[Tensor, "n d"]:
    return target[(points[:, None] - target[None]).square().sum(dim=2).argmin(dim=1)]


def _to_nearest(points: Float[Tensor, "n d"], target: Float[Tensor, "m d"]) -> Float[Tensor, "n d"]:
    return _nearest(points, target) - points


def _unit_pull(points: Float[Tensor, "n d"], target: Float[Tensor, "m d"]) -> Float[Tensor, "n d"]:
    arrows = _to_nearest(points, target)
    lengths = arrows.norm(dim=1, keepdim=True)
    return arrows / torch.where(lengths > 0, lengths, torch.ones_like(lengths))


def line_arrows(function: object) -> None:
    """Check ``function(points, target, direction)``: the arrow of transport along one direction at every point."""
    mistakes = [
        Mistake(
            lambda x, y, u: -_along(x, y, u),
            "the arrows point away from the target: subtract the point from the target, not the reverse",
        ),
        Mistake(
            lambda x, y, u: ((y @ u).sort().values - (x @ u).sort().values)[:, None] * u,
            "the arrows are right but in the order of the sorted points: undo the sorting",
        ),
        Mistake(
            lambda x, y, u: (y @ u - x @ u)[:, None] * u,
            "points are paired in their original order; transport on a line pairs them by rank: sort both sides",
        ),
        Mistake(
            lambda x, y, u: ((y @ u)[(x @ u).argsort().argsort()] - x @ u)[:, None] * u,
            "the points are ranked, but the targets are not sorted",
        ),
        Mistake(
            lambda x, y, u: ((y @ u).sort().values[(x @ u).argsort()] - x @ u)[:, None] * u,
            "argsort gives the order, not the ranks: apply argsort again, or assign through the order",
        ),
        Mistake(
            lambda x, y, u: y[(y @ u).argsort()[(x @ u).argsort().argsort()]] - x,
            "the partners are right, but a direction moves points along itself only: project the arrow on it",
        ),
    ]
    generator = np.random.default_rng(1)
    x, y = (torch.from_numpy(generator.normal(size=(8, 2))) for _ in range(2))
    u = torch.tensor([0.6, 0.8], dtype=torch.float64)
    solid = [torch.from_numpy(generator.normal(size=(5, 3))) for _ in range(2)]
    cases = [
        Case("8 points and a slanting direction", (x, y, u)),
        Case("the same points, the direction reversed", (x, y, -u)),
        Case("a horizontal direction", (x[:5], y[:5], torch.tensor([1.0, 0.0], dtype=torch.float64))),
        Case("one point", (x[:1], y[:1], u)),
        Case("a target that is the points, shuffled", (x, x.flip(0), u)),
        Case("points in R³", (*solid, torch.tensor([2.0, -1.0, 2.0], dtype=torch.float64) / 3)),
    ]
    check_answer(function, _along, cases, mistakes, "line_arrows")


def _along(
    points: Float[Tensor, "n d"], target: Float[Tensor, "n d"], direction: Float[Tensor, " d"]
) -> Float[Tensor, "n d"]:
    ranks = (points @ direction).argsort().argsort()
    return ((target @ direction).sort().values[ranks] - points @ direction)[:, None] * direction


def largest_rate(function: object) -> None:
    """Check ``function(n_selections, momentum)``: the learning rate at which summed Chamfer becomes unstable."""
    mistakes = [
        Mistake(lambda k, b: 1 / (1 + k), "that is the bound without momentum; with momentum larger steps are stable"),
        Mistake(
            lambda k, b: 2 * (1 + b),
            "this does not depend on the number of selections; the curvature at such a point does",
        ),
        Mistake(
            lambda k, b: (1 + b) / k if k else 2 * (1 + b),
            "each selection is one square, and the point has a nearest target point too: one more square",
        ),
        Mistake(lambda k, b: 2 * (1 + b) / (1 + k), "the curvature of |x − y|² is 2, not 1"),
        Mistake(
            lambda k, b: (1 - b) / (1 + k),
            "the sign of the momentum is wrong: 1 − momentum sets the speed, not the stability",
        ),
    ]
    pairs = [(0, 0.0), (0, 0.9), (1, 0.0), (1, 0.9), (4, 0.5), (30, 0.9), (678, 0.99)]
    cases = [Case(f"{n} selections and momentum {momentum}", (n, momentum)) for n, momentum in pairs]
    check_answer(function, lambda n, momentum: (1 + momentum) / (1 + n), cases, mistakes, "largest_rate")
