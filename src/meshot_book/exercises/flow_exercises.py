"""Chapter 20: a flow by Euler steps, one step undone, and how fine a mesh must be."""

import math

import numpy as np
import torch

from meshot.types import Float, Tensor
from meshot_book.exercises.verdict import Case, Mistake, check_answer


def _spin(time: float, points: Float[Tensor, "n 2"]) -> Float[Tensor, "n 2"]:
    return torch.stack([-points[:, 1], points[:, 0]], dim=1)


def _hurry(time: float, points: Float[Tensor, "n 2"]) -> Float[Tensor, "n 2"]:
    return (1 + 3 * time) * _spin(time, points)


def _grow(time: float, points: Float[Tensor, "n d"]) -> Float[Tensor, "n d"]:
    return points * (1 - points) + time**2


def _still(time: float, points: Float[Tensor, "n d"]) -> Float[Tensor, "n d"]:
    return torch.zeros_like(points)


def euler_flow(function: object) -> None:
    """Check ``function(velocity, points, n_steps)``: the flow on [0, 1] by equal Euler steps."""
    mistakes = [
        Mistake(
            lambda v, x, n: _euler(lambda t, y: v(0.0, y), x, n), "the time does not advance; step k begins at k / n"
        ),
        Mistake(
            lambda v, x, n: _euler(lambda t, y: v(t + 1 / n, y), x, n),
            "each step uses the velocity at its end; Euler's method uses that at its beginning",
        ),
        Mistake(
            lambda v, x, n: x + sum(v(k / n, x) for k in range(n)) / n,
            "every step uses the velocity at the initial positions; use the current positions",
        ),
        Mistake(lambda v, x, n: _euler(lambda t, y: n * v(t, y), x, n), "the steps have length 1; they are 1 / n long"),
        Mistake(lambda v, x, n: _euler(v, x, n, n - 1), "one step is missing; count them"),
        Mistake(lambda v, x, n: _euler(v, x, n, n + 1), "one step too many; the last one begins at 1 − 1 / n"),
        Mistake(lambda v, x, n: x + v(0.0, x), "this is a single step of length 1, whatever n_steps says"),
        Mistake(
            lambda v, x, n: _euler(lambda t, y: -v(t, y), x, n),
            "the points move against the velocity: the sign is wrong",
        ),
    ]
    points = torch.from_numpy(np.random.default_rng(0).normal(size=(6, 2)))
    cases = [
        Case("a rotation in 7 steps", (_spin, points, 7)),
        Case("a rotation that speeds up, in 5 steps", (_hurry, points, 5)),
        Case("a field that bends, in 4 steps", (_grow, points, 4)),
        Case("a single step", (_hurry, points, 1)),
        Case("no velocity", (_still, points, 3)),
        Case("points on a line", (_grow, points[:, :1], 6)),
    ]
    check_answer(function, _euler, cases, mistakes, "euler_flow")


def _euler(velocity: object, points: Tensor, n_steps: int, n_taken: int | None = None) -> Tensor:
    for k in range(n_steps if n_taken is None else n_taken):
        points = points + velocity(k / n_steps, points) / n_steps
    return points


def _whirl(points: Float[Tensor, "n 2"]) -> Float[Tensor, "n 2"]:
    return _spin(0.0, points) * torch.exp(-points.square().sum(dim=1, keepdim=True) / 2)


def _wave(points: Float[Tensor, "n d"]) -> Float[Tensor, "n d"]:
    return points.sin()


def _half(points: Float[Tensor, "n d"]) -> Float[Tensor, "n d"]:
    return points / 2 + 1


def undo_step(function: object) -> None:
    """Check ``function(velocity, images, step)``: the points that one Euler step has carried to ``images``."""
    mistakes = [
        Mistake(
            lambda v, y, h: y - h * v(y),
            "this uses the velocity at the image; the step used the velocity at the unknown point: iterate",
        ),
        Mistake(
            lambda v, y, h: y - h * v(y - h * v(y)),
            "the iteration is right, but two steps are not enough; repeat until it converges",
        ),
        Mistake(lambda v, y, h: y + h * v(y), "that is one more step forward"),
        Mistake(lambda v, y, h: _undone(lambda x: -v(x), y, h), "the sign: x + h v(x) = y, so x = y − …"),
        Mistake(lambda v, y, h: y, "these are the images themselves"),
    ]
    points = torch.from_numpy(np.random.default_rng(1).normal(size=(6, 2)))
    cases = [
        Case("a whirl, step 0.5", (_whirl, points, 0.5)),
        Case("a wave, step 0.9", (_wave, points, 0.9)),
        Case("a linear field, step 0.8", (_half, points, 0.8)),
        Case("a step of length zero", (_wave, points, 0.0)),
        Case("points on a line, step 0.6", (_wave, points[:, :1], 0.6)),
    ]
    check_answer(function, _undone, cases, mistakes, "undo_step")


def _undone(velocity: object, images: Tensor, step: float) -> Tensor:
    points = images
    for _ in range(400):
        points = images - step * velocity(points)
    return points


def pieces_needed(function: object) -> None:
    """Check ``function(length, bend, gap)``: the fewest equal pieces of a side whose chords stay within the gap."""
    mistakes = [
        Mistake(
            lambda s, c, g: math.ceil(s * math.sqrt(c / 2 / g)),
            "the factor is wrong: a chord is farthest from its arc in the middle of the arc",
        ),
        Mistake(lambda s, c, g: math.ceil(s * math.sqrt(c / g)), "the distance between chord and arc has a factor 1/8"),
        Mistake(
            lambda s, c, g: math.ceil(s**2 * c / 8 / g),
            "that is the distance of one chord over the gap; it falls with the square of the number of pieces",
        ),
        Mistake(lambda s, c, g: math.floor(s * math.sqrt(c / 8 / g)), "rounded down; the pieces are then too long"),
        Mistake(lambda s, c, g: s * math.sqrt(c / 8 / g), "a number of pieces is whole: round it up"),
        Mistake(lambda s, c, g: math.ceil(c * math.sqrt(s / 8 / g)), "length and curvature are exchanged"),
    ]
    triples = [
        (2.0, 11.0, 0.3),
        (2.0, 0.5, 0.3),
        (5.0, 2.0, 0.011),
        (1.0, 40.0, 0.21),
        (0.1, 1.0, 0.5),
        (3.0, 7.0, 0.05),
    ]
    cases = [Case(f"length {s}, bend {c}, gap {g}", (s, c, g)) for s, c, g in triples]
    check_answer(function, _pieces, cases, mistakes, "pieces_needed")


def _pieces(length: float, bend: float, gap: float) -> int:
    return max(1, math.ceil(length * math.sqrt(bend / (8 * gap))))
