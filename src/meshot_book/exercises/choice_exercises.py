"""Chapter 39: the rate of a candidate, the average of weights, and the luck of the best of several scores."""

import functools

import numpy as np
import scipy.integrate
import scipy.stats
import torch

from meshot.types import Float, Tensor
from meshot_book.exercises.verdict import Case, Mistake, check_answer


def chosen_rate(function: object) -> None:
    """Check ``function(rates, distances)``: the rate with the lowest mean distance over the second half of checks."""
    mistakes = [
        Mistake(
            lambda r, d: r[int(np.argmin([each[-1] for each in d]))],
            "this compares the last checks only; one check is noisy: take the mean over the second half",
        ),
        Mistake(
            lambda r, d: r[int(np.argmin([min(each) for each in d]))],
            "this compares the lowest checks; the lowest of several noisy numbers is too low: take the mean over the "
            "second half",
        ),
        Mistake(
            lambda r, d: r[int(np.argmin([np.mean(each) for each in d]))],
            "this is the mean over all checks; the first half says how fast a training begins, not where it ends",
        ),
        Mistake(
            lambda r, d: int(np.argmin([_late(each) for each in d])), "this is the number of the rate, not the rate"
        ),
        Mistake(lambda r, d: r[int(np.argmax([_late(each) for each in d]))], "the smallest distance is the best"),
    ]
    steady, noisy = [0.40, 0.35, 0.30, 0.29, 0.28, 0.27], [0.40, 0.36, 0.33, 0.25, 0.36, 0.35]
    cases = [
        Case("three trainings that fall", ([1e-4, 3e-4, 1e-3], [[0.4, 0.38, 0.37, 0.36], steady[:4], noisy[:2] * 2])),
        Case("one check that is low by chance", ([5e-4, 2e-3], [steady, noisy])),
        Case("a fast start and a bad end", ([5e-4, 2e-3], [[0.5, 0.45, 0.33, 0.30], [0.3, 0.3, 0.34, 0.33]])),
        Case("a last check that is low by chance", ([5e-4, 2e-3], [[0.4, 0.4, 0.38, 0.38, 0.39, 0.26], steady])),
    ]
    check_answer(function, _chosen, cases, mistakes, "chosen_rate")


def _late(checks: list[float]) -> float:
    return float(np.mean(checks[len(checks) // 2 :]))


def _chosen(rates: list[float], distances: list[list[float]]) -> float:
    return rates[int(np.argmin([_late(each) for each in distances]))]


def averaged_weights(function: object) -> None:
    """Check ``function(weights, decay)``: the exponential average after the last step, begun with the first weights."""
    mistakes = [
        Mistake(lambda w, c: w[-1], "these are the weights of the last step; the average remembers earlier ones"),
        Mistake(lambda w, c: w.mean(dim=0), "this is the mean of all steps; later steps have larger shares"),
        Mistake(lambda w, c: _averaged(w, 1 - c), "`decay` is the share of the average so far, not that of the step"),
        Mistake(
            lambda w, c: _averaged(torch.cat([0 * w[:1], w]), c),
            "the average begins with the first weights, not with zero",
        ),
        Mistake(lambda w, c: _averaged(w.flip(0), c), "this goes through the steps from the last one to the first"),
    ]
    steps = torch.tensor([[1.0, -2.0], [0.5, 3.0], [2.0, 1.0], [4.0, 0.0]], dtype=torch.float64)
    cases = [
        Case("four steps of two weights", (steps, 0.9)),
        Case("a short memory", (steps, 0.2)),
        Case("a single step", (steps[2:3], 0.99)),
    ]
    check_answer(function, _averaged, cases, mistakes, "averaged_weights")


def _averaged(weights: Float[Tensor, "t k"], decay: float) -> Float[Tensor, " k"]:
    return functools.reduce(lambda average, own: decay * average + (1 - decay) * own, weights[1:], weights[0])


def luck_of_the_best(function: object) -> None:
    """Check ``function(n, deviation)``: the mean of the smallest of n equal scores with normal errors, minus theirs."""
    mistakes = [
        Mistake(lambda n, s: -_luck(n, s), "the smallest score is too small, so the number is negative"),
        Mistake(
            lambda n, s: _luck(n, 1.0), "this is the luck for a deviation of one; it is proportional to the deviation"
        ),
        Mistake(lambda n, s: -s / n**0.5, "this is the error of a mean of n scores; the smallest of them is asked for"),
        Mistake(
            lambda n, s: s * float(scipy.stats.norm.ppf(1 / (n + 1))),
            "this is a quantile; the mean of the smallest score is asked for",
        ),
        Mistake(
            lambda n, s: -s * (2 * np.log(n)) ** 0.5, "this is the limit for a very large number of scores; n is small"
        ),
    ]
    cases = [
        Case("two scores", (2, 0.01)),
        Case("a single score", (1, 0.02)),
        Case("fourteen scores", (14, 0.006)),
    ]
    check_answer(function, _luck, cases, mistakes, "luck_of_the_best")


def _luck(n: int, deviation: float) -> float:
    normal = scipy.stats.norm
    return deviation * scipy.integrate.quad(lambda x: x * n * normal.pdf(x) * normal.sf(x) ** (n - 1), -12, 12)[0]
