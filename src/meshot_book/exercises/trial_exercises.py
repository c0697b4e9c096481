"""A trial of a loss: what its fall means, where one training leads another, and a forecast with its interval."""

import numpy as np
import scipy.stats
import torch

from meshot.types import Float, Tensor
from meshot_book.exercises.verdict import Case, Mistake, check_answer


def diagnosis(function: object) -> None:
    """Check ``function(seen, new, distance)``: 0 no descent, 1 overfitted, 2 insensitive to the distance, 3 helps."""
    mistakes = [
        Mistake(
            lambda seen, new, distance: 2 if seen < 1 and distance >= 1 else _diagnosis(seen, new, distance),
            "a distance that grows where the loss grows, too, says nothing about the loss; ask for the loss first",
        ),
        Mistake(
            lambda seen, new, distance: _diagnosis(seen, seen, distance),
            "a loss that falls on training subjects only is overfitted; the quotient of new subjects is not used",
        ),
        Mistake(
            lambda seen, new, distance: _diagnosis(new, new, distance),
            "the quotient of training subjects is not used; only a loss that falls there can be overfitted",
        ),
        Mistake(
            lambda seen, new, distance: _diagnosis(seen - 1e-9, new - 1e-9, distance - 1e-9),
            "a quotient of exactly 1 is no improvement",
        ),
        Mistake(
            lambda seen, new, distance: _diagnosis(1 / seen, 1 / new, 1 / distance),
            "the quotients are after / before: below 1 is an improvement",
        ),
    ]
    cases = [
        Case("a loss and a distance that fall", (0.7, 0.8, 0.9)),
        Case("a distance that grows", (0.7, 0.8, 1.2)),
        Case("a loss that grows on new subjects, with the distance", (0.7, 1.1, 1.2)),
        Case("a loss that grows on new subjects alone", (0.7, 1.1, 0.9)),
        Case("a loss that grows on all subjects", (1.1, 1.2, 1.3)),
        Case("a loss that grows on training subjects only", (1.1, 0.9, 0.9)),
        Case("a distance that stays", (0.7, 0.8, 1.0)),
        Case("a loss that stays", (1.0, 0.9, 0.9)),
    ]
    check_answer(function, _diagnosis, cases, mistakes, "diagnosis")


def _diagnosis(seen: float, new: float, distance: float) -> int:
    return next((k for k, quotient in enumerate((seen, new, distance)) if quotient >= 1), 3)


def first_lead(function: object) -> None:
    """Check ``function(steps, ours, other)``: the step from which on ours is nearer at every check, −1 if none."""
    mistakes = [
        Mistake(
            lambda s, a, b: next((step for step, x, y in zip(s, a, b) if x < y), -1),
            "this is the first check at which ours is nearer; at a later check it may be farther again",
        ),
        Mistake(
            lambda s, a, b: _lead(list(range(len(s))), a, b), "this is the number of the check; the step is asked for"
        ),
        Mistake(lambda s, a, b: _lead(s, b, a), "this is the step from which on the other one is nearer"),
        Mistake(
            lambda s, a, b: next((step for step, x, y in zip(s[::-1], a[::-1], b[::-1]) if x >= y), -1),
            "this is the last check at which ours is not nearer; the next one is asked for",
        ),
        Mistake(
            lambda s, a, b: s[0] if _lead(s, a, b) == -1 else _lead(s, a, b),
            "if ours is not nearer at the last check, the answer is −1",
        ),
    ]
    steps = [280, 560, 840, 1120, 1400]
    cases = [
        Case("a lead that begins late", (steps, [0.5, 0.4, 0.3, 0.25, 0.2], [0.4, 0.35, 0.31, 0.3, 0.3])),
        Case("a lead that is lost once", (steps, [0.5, 0.3, 0.4, 0.25, 0.2], [0.4, 0.35, 0.31, 0.3, 0.3])),
        Case("a lead from the beginning", (steps, [0.3, 0.3, 0.2, 0.2, 0.1], [0.4, 0.35, 0.31, 0.3, 0.3])),
        Case("no lead at the end", (steps, [0.3, 0.3, 0.2, 0.2, 0.3], [0.4, 0.35, 0.31, 0.3, 0.29])),
    ]
    check_answer(function, _lead, cases, mistakes, "first_lead")


def _lead(steps: list[int], ours: list[float], other: list[float]) -> int:
    behind = [i for i, (a, b) in enumerate(zip(ours, other)) if a >= b]
    first = behind[-1] + 1 if behind else 0
    return steps[first] if first < len(steps) else -1


def forecast(function: object) -> None:
    """Check ``function(steps, distances, at)``: a power law, continued: the distance there, and its interval."""
    mistakes = [
        Mistake(
            lambda s, d, at: _forecast(s, d, at, own=0.0),
            "this is the interval of the line; a single check scatters about it, too: there is a 1 under the root",
        ),
        Mistake(
            lambda s, d, at: _forecast(s, d, at, quantile=lambda n: 1.96),
            "1.96 belongs to a normal distribution; with few checks the quantile of Student's t is larger",
        ),
        Mistake(
            lambda s, d, at: _forecast(s, d, at, quantile=lambda n: scipy.stats.t.ppf(0.975, n - 1)),
            "a line has two numbers, so that n − 2 degrees of freedom are left",
        ),
        Mistake(
            lambda s, d, at: _forecast(s, d, at, far=0.0),
            "the interval does not grow with the distance from the checks; the slope is uncertain, too",
        ),
        Mistake(
            lambda s, d, at: _forecast(s.exp(), d.exp(), float(np.exp(at))).log(),
            "this line is fitted to the numbers as they are; a power law is a line between logarithms",
        ),
        Mistake(lambda s, d, at: _forecast(s, d, at).log(), "these are logarithms; return distances"),
    ]
    steps = torch.tensor([2.0, 4.0, 6.0, 8.0, 12.0], dtype=torch.float64)
    noise = torch.tensor([1.02, 0.97, 1.01, 1.03, 0.98], dtype=torch.float64)
    cases = [
        Case("distances that fall and scatter", (steps, 0.5 * steps**-0.3 * noise, 40.0)),
        Case("a forecast within the checks", (steps, 0.5 * steps**-0.3 * noise, 7.0)),
        Case("distances that do not fall", (steps, 0.3 * noise, 40.0)),
        Case("three checks", (steps[:3], 0.4 * steps[:3] ** -0.5 * noise[:3], 12.0)),
    ]
    check_answer(function, _forecast, cases, mistakes, "forecast")


def _of_student(n: int) -> float:
    return float(scipy.stats.t.ppf(0.975, n - 2))


def _forecast(
    steps: Float[Tensor, " n"],
    distances: Float[Tensor, " n"],
    at: float,
    own: float = 1.0,
    far: float = 1.0,
    quantile: object = _of_student,
) -> Float[Tensor, " 3"]:
    x, y, n = steps.log(), distances.log(), len(steps)
    away = x - x.mean()
    slope = (away * y).sum() / away.square().sum()
    rest = y - y.mean() - slope * away
    beyond = float(np.log(at)) - x.mean()
    spread = own + 1 / n + far * beyond**2 / away.square().sum()
    half = quantile(n) * (rest.square().sum() / (n - 2) * spread).sqrt()
    middle = y.mean() + slope * beyond
    return torch.stack([middle, middle - half, middle + half]).exp()
