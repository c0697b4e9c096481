"""Chapter 35: paired differences, which check of a training is kept, and the order of a solver."""

import numpy as np
import torch

from meshot.types import Float, Tensor
from meshot_book.exercises.verdict import Case, Mistake, check_answer


def paired_gap(function: object) -> None:
    """Check ``function(first, second)``: the mean difference over the same subjects, and its standard error."""
    mistakes = [
        Mistake(
            lambda x, y: _gap(x, y, _unpaired),
            "this is the standard error of two independent groups; the same subjects are in both: take the standard "
            "deviation of the differences",
        ),
        Mistake(
            lambda x, y: _gap(x, y, lambda d, *_: d.std(correction=1)),
            "this is the standard deviation of the differences; that of their mean is smaller by √n",
        ),
        Mistake(
            lambda x, y: _gap(x, y, lambda d, *_: d.std(correction=0) / len(d) ** 0.5),
            "the standard deviation is that of a sample: divide by n − 1, not by n",
        ),
        Mistake(
            lambda x, y: _gap(x, y, lambda d, *_: d.std(correction=1) / len(d)),
            "divided by n; the standard error is the standard deviation over √n",
        ),
        Mistake(lambda x, y: _gap(y, x), "the sign is reversed: it is first minus second"),
    ]
    random = np.random.default_rng(2)
    base, change = torch.from_numpy(random.normal(size=8)), torch.from_numpy(random.normal(0.1, 0.05, 8))
    cases = [
        Case("eight subjects that differ much, changed alike", (base + change, base)),
        Case("two subjects", (base[:2], base[:2] + change[:2])),
        Case("a constant difference", (base + 0.25, base)),
    ]
    check_answer(function, _gap, cases, mistakes, "paired_gap")


def _paired(differences: Tensor, first: Tensor, second: Tensor) -> Tensor:
    return differences.std(correction=1) / len(differences) ** 0.5


def _unpaired(differences: Tensor, first: Tensor, second: Tensor) -> Tensor:
    return ((first.var(correction=1) + second.var(correction=1)) / len(first)).sqrt()


def _gap(first: Float[Tensor, " n"], second: Float[Tensor, " n"], error: object = _paired) -> Float[Tensor, " 2"]:
    differences = first - second
    return torch.stack([differences.mean(), error(differences, first, second)])


def kept_check(function: object) -> None:
    """Check ``function(initial, checks)``: the number of the check that is kept, or −1 for the initial surface."""
    mistakes = [
        Mistake(
            lambda a, c: int(np.argmin(c)),
            "the initial surface is a candidate too: return −1 where no check is below it",
        ),
        Mistake(
            lambda a, c: -1 if c[-1] >= a else len(c) - 1,
            "this keeps the last check; an earlier one may be nearer to the truth",
        ),
        Mistake(
            lambda a, c: next((i for i, value in enumerate(c) if value < a), -1),
            "this keeps the first check below the initial distance; a later one may be smaller",
        ),
        Mistake(
            lambda a, c: int(np.argmax(c)) if max(c) > a else -1, "distances: the smallest is the best, not the largest"
        ),
        Mistake(
            lambda a, c: len(c) - 1 - int(np.argmin(c[::-1])) if min(c) < a else -1,
            "of equal checks the first is kept, because it needs fewer steps",
        ),
    ]
    cases = [
        Case("a training that improves to its end", (0.31, [0.30, 0.27, 0.24, 0.23])),
        Case("a training that improves and turns back", (0.31, [0.30, 0.26, 0.28, 0.33])),
        Case("a training that only gets worse", (0.31, [0.38, 0.40, 0.42])),
        Case("two equal checks", (0.31, [0.25, 0.22, 0.22, 0.29])),
        Case("a check as far as the initial surface", (0.31, [0.31, 0.35])),
    ]
    check_answer(function, _kept, cases, mistakes, "kept_check")


def _kept(initial: float, checks: list[float]) -> int:
    return int(np.argmin(checks)) if min(checks) < initial else -1


def observed_order(function: object) -> None:
    """Check ``function(n_steps, errors)``: the order q for which errors fall as steps^(−q), by least squares."""
    mistakes = [
        Mistake(lambda n, e: -_order(n, e), "the sign is reversed: errors that decrease have a positive order"),
        Mistake(
            lambda n, e: float(torch.log(e[0] / e[-1]) / torch.log(n[-1] / n[0])),
            "this uses the first and the last run only; fit a line through all of them by least squares",
        ),
        Mistake(
            lambda n, e: -float(np.polyfit(n.numpy(), e.log().numpy(), 1)[0]),
            "the steps need a logarithm too: a power law is a line where both axes are logarithmic",
        ),
        Mistake(
            lambda n, e: -float(np.polyfit(n.log().numpy(), e.numpy(), 1)[0]),
            "the errors need a logarithm too: a power law is a line where both axes are logarithmic",
        ),
        Mistake(
            lambda n, e: -float((n.log() * e.log()).sum() / (n.log() ** 2).sum()),
            "this line is forced through the origin; the power law has a constant in front",
        ),
    ]
    steps = torch.tensor([1.0, 5.0, 10.0, 50.0], dtype=torch.float64)
    noisy = 0.4 / steps * torch.tensor([1.2, 0.9, 1.1, 0.95], dtype=torch.float64)
    cases = [
        Case("Euler's method", (steps, 0.4 / steps)),
        Case("a method of order four", (steps[1:], 3.0 / steps[1:] ** 4)),
        Case("errors that scatter", (steps, noisy)),
        Case("two runs", (steps[:2], torch.tensor([0.3, 0.05], dtype=torch.float64))),
    ]
    check_answer(function, _order, cases, mistakes, "observed_order")


def _order(n_steps: Float[Tensor, " r"], errors: Float[Tensor, " r"]) -> float:
    return -float(np.polyfit(n_steps.log().numpy(), errors.log().numpy(), 1)[0])
