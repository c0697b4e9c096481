"""Chapter 34: thin gyri between grid points, a Chamfer distance weighted by curvature, and chains of flows."""

from collections.abc import Callable, Sequence

import numpy as np
import torch

from meshot.types import Float, Tensor
from meshot_book.exercises.verdict import Case, Mistake, check_answer

_Field = Callable[[Tensor], Tensor]


def chance_missed(function: object) -> None:
    """Check ``function(thickness, spacing)``: how often no layer of a grid falls into a slab parallel to it."""
    mistakes = [
        Mistake(
            lambda t, h: min(1.0, t / h), "this is the chance that a layer falls into the slab; the other is asked"
        ),
        Mistake(lambda t, h: 1 - t / h, "below zero this is no chance; how often is a slab missed that is thick?"),
        Mistake(lambda t, h: float(t < h), "a slab thinner than the spacing is met by some positions of the grid"),
        Mistake(lambda t, h: max(0.0, 1 - 2 * t / h), "the slab has its thickness once, not on both sides"),
        Mistake(lambda t, h: max(0.0, 1 - t / (2 * h)), "the grid repeats after one spacing, not after two"),
        Mistake(lambda t, h: max(0.0, 1 - h / t), "thickness and spacing are exchanged"),
        Mistake(lambda t, h: max(0.0, 1 - t / h) ** 3, "the slab is parallel to the layers: only one axis matters"),
    ]
    cases = [
        Case("a slab half as thick as the spacing", (0.5, 1.0)),
        Case("a slab of 1.2 mm and voxels of 1.5 mm", (1.2, 1.5)),
        Case("a slab as thick as the spacing", (1.0, 1.0)),
        Case("a thick slab", (3.0, 1.0)),
        Case("a slab without thickness", (1e-9, 2.0)),
    ]
    check_answer(function, lambda t, h: max(0.0, 1 - t / h), cases, mistakes, "chance_missed")


def curved_chamfer(function: object) -> None:
    """Check ``function(points, truths, curvatures, most)``: the Chamfer distance weighted by the target's curvature."""
    mistakes = [
        Mistake(lambda *a: _curved(*a[:2], 0 * a[2], a[3]), "the curvature changes nothing in your sum"),
        Mistake(lambda *a: _curved(*a[:3], torch.inf), "a weight may not exceed `most`"),
        Mistake(lambda x, y, k, most: _curved(x, y, k, most, one=0.0), "the weight of a flat place is one, not zero"),
        Mistake(lambda *a: _curved(*a, power=1), "the distances are squared"),
        Mistake(lambda *a: _curved(*a, there=False), "the nearest neighbours of the found points are missing"),
        Mistake(lambda *a: _curved(*a, back=False), "the nearest neighbours of the true points are missing"),
        Mistake(
            lambda *a: _curved(*a, plain=True),
            "pairs of the first direction have a weight too: the curvature at the true point of the pair",
        ),
        Mistake(lambda *a: _curved(*a, mean=False), "each direction is a mean over its points, not a sum"),
    ]
    random = np.random.default_rng(0)
    found, truths = (torch.from_numpy(random.normal(size=(n, 3))) for n in (12, 9))
    curvatures = torch.from_numpy(random.uniform(0.2, 8.0, 9))
    cases = [
        Case("twelve points and nine", (found, truths, curvatures, 5.0)),
        Case("weights that are all small", (found, truths, curvatures / 4, 5.0)),
        Case("one pair", (found[:1], truths[:1], curvatures[:1], 2.0)),
    ]
    check_answer(function, _curved, cases, mistakes, "curved_chamfer")


def _curved(
    points: Float[Tensor, "n 3"], truths: Float[Tensor, "m 3"], curvatures: Float[Tensor, " m"], most: float,
    one: float = 1.0, power: int = 2, there: bool = True, back: bool = True, plain: bool = False, mean: bool = True,
) -> Float[Tensor, ""]:  # fmt: skip
    weights = (one + curvatures).clamp(max=most)
    gaps = torch.cdist(points, truths)
    nearest = gaps.min(dim=1)
    first = (1.0 if plain else weights[nearest.indices]) * nearest.values**power
    second = weights * gaps.min(dim=0).values ** power
    reduce = torch.mean if mean else torch.sum
    return there * reduce(first) + back * reduce(second)


def through_chain(function: object) -> None:
    """Check ``function(fields, points, n_steps)``: points after the flows of several fields, by RK4, one by one."""
    mistakes = [
        Mistake(
            lambda fields, x, n: _chain([lambda p: sum(f(p) for f in fields)], x, n),
            "this is the flow of the sum of the fields; each flow begins where the one before it ended",
        ),
        Mistake(lambda fields, x, n: _chain(fields[::-1], x, n), "the flows are in the reverse order"),
        Mistake(
            lambda fields, x, n: _chain(fields, x, n, _euler), "this is Euler's method; RK4 takes four slopes a step"
        ),
        Mistake(
            lambda fields, x, n: _chain(fields, x, n, _midpoint), "this is the midpoint rule; RK4 takes four slopes"
        ),
        Mistake(
            lambda fields, x, n: _chain(fields, x, n, length=1 / len(fields)),
            "every field acts for one unit of time, not for a share of it",
        ),
        Mistake(lambda fields, x, n: _chain(fields, x, n, length=n), "the steps of a field have length 1 / n_steps"),
        Mistake(lambda fields, x, n: _chain(fields, x, 1), "only one step for every field; n_steps are needed"),
        Mistake(lambda fields, x, n: _chain(fields[:1], x, n), "only the first field acts"),
    ]
    points = torch.from_numpy(np.random.default_rng(1).normal(size=(5, 3)))
    turn = points.new_tensor([[0.0, -2.0, 0.0], [2.0, 0.0, 0.5], [0.0, 0.0, 1.0]])

    def turned(x: Tensor) -> Tensor:
        return x @ turn.T

    def waved(x: Tensor) -> Tensor:
        return torch.sin(3 * x.roll(1, dims=1))

    cases = [
        Case("a rotation and a wave", ([turned, waved], points, 4)),
        Case("three fields", ([waved, turned, waved], points[:2], 3)),
        Case("a wave and a rotation, two steps", ([waved, turned], points, 2)),
    ]
    check_answer(function, _chain, cases, mistakes, "through_chain")


def _rk4(field: _Field, x: Tensor, h: float) -> Tensor:
    first = field(x)
    second = field(x + h / 2 * first)
    third = field(x + h / 2 * second)
    return x + h / 6 * (first + 2 * second + 2 * third + field(x + h * third))


def _midpoint(field: _Field, x: Tensor, h: float) -> Tensor:
    return x + h * field(x + h / 2 * field(x))


def _euler(field: _Field, x: Tensor, h: float) -> Tensor:
    return x + h * field(x)


def _chain(
    fields: Sequence[_Field], points: Float[Tensor, "n 3"], n_steps: int, step: Callable = _rk4, length: float = 1.0
) -> Float[Tensor, "n 3"]:
    for field in fields:
        for _ in range(n_steps):
            points = step(field, points, length / n_steps)
    return points
