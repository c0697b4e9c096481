"""Chapter 11: how many points a bound asks for, the curve that lies about its exponent, and a gap without a bound."""

import math

import numpy as np
import torch

from meshot.types import Float, Tensor
from meshot_book.exercises.verdict import Case, Mistake, check_answer


def points_needed(function: object) -> None:
    """Check ``function(p, joint, first, second, tolerance)``: the least m at which the sharper bound is that low."""
    mistakes = [
        Mistake(lambda *a: math.ceil(_root(*a)), "the bound falls with the root of m: solve for √m, then square"),
        Mistake(lambda *a: _root(*a) ** 2, "this is no whole number of points: round it up"),
        Mistake(lambda *a: math.floor(_root(*a) ** 2), "rounded down, the bound is just above the tolerance"),
        Mistake(
            lambda p, joint, *rest: math.ceil((joint * _root(p, joint, *rest)) ** 2),
            "the joint diameter enters with the power p − 1, as in the derivative of |a|^p",
        ),
        Mistake(
            lambda p, *rest: math.ceil((_root(p, *rest) / p) ** 2),
            "the factor p, from the derivative of |a|^p, is missing",
        ),
        Mistake(lambda *a: math.ceil(4 * _root(*a) ** 2), "four times too many: √(F(1 − F)) is at most ½"),
        Mistake(
            lambda p, joint, first, second, tolerance: _least(p, joint, joint, joint, tolerance),
            "each surface enters with its own diameter; only the derivative of |a|^p uses the joint diameter",
        ),
        Mistake(
            lambda p, joint, first, second, tolerance: _least(p, max(first, second), first, second, tolerance),
            "the distance between the supports is missing: the derivative of |a|^p uses the joint diameter",
        ),
    ]
    rows = [(1, 100.0, 80.0, 76.0, 1.0), (2, 1078.0, 80.0, 76.0, 500.0), (2, 80.0, 80.0, 76.0, 100.0)]
    rows += [(3, 5.0, 2.0, 3.5, 7.0), (2, 3.0, 1.0, 2.0, 0.3), (1, 9.0, 1.0, 1.0, 0.25)]
    names = [
        "spheres, p = 1",
        "spheres far apart, p = 2",
        "concentric spheres",
        "p = 3",
        "a small pair",
        "an exact root",
    ]
    cases = [Case(name, row) for name, row in zip(names, rows)]
    check_answer(function, _least, cases, mistakes, "points_needed")


def _root(p: float, joint: float, first: float, second: float, tolerance: float) -> float:
    return p * joint ** (p - 1) * (first + second) / (2 * tolerance)


def _least(p: float, joint: float, first: float, second: float, tolerance: float) -> int:
    return math.ceil(_root(p, joint, first, second, tolerance) ** 2)


def wrong_curve(function: object) -> None:
    """Check ``function(x, errors, claimed)``: which curve does not have the exponent that its legend claims."""
    mistakes = [
        Mistake(
            lambda x, e, c: int(e[:, 0].argmax()),
            "that is the highest curve; compare slopes, since a constant factor does not change them",
        ),
        Mistake(
            lambda x, e, c: int(e[:, -1].argmax()),
            "that is the curve with the largest last error; compare slopes instead",
        ),
        Mistake(
            lambda x, e, c: int(_fits(x, e).argmin()),
            "that is the steepest curve; compare its slope with the slope that is claimed for it",
        ),
        Mistake(
            lambda x, e, c: int(_fits(x, e).argmax()),
            "that is the flattest curve; compare its slope with the slope that is claimed for it",
        ),
        Mistake(
            lambda x, e, c: int(c.argmax()),
            "that is the curve with the flattest claimed slope; compare each claim with its points",
        ),
        Mistake(
            lambda x, e, c: int(c.argmin()),
            "that is always the steepest claim: take logarithms of sizes and errors, and check the signs",
        ),
        Mistake(
            lambda x, e, c: int((_fits(x, e) - c).argmax()),
            "a curve can also fall faster than it claims: take the size of the difference",
        ),
    ]
    check_answer(function, _wrong, [_drawn_case(seed) for seed in range(12)], mistakes, "wrong_curve")


def drawn_curves(seed: int) -> tuple[Float[Tensor, " n"], Float[Tensor, "k n"], Float[Tensor, " k"]]:
    """Sizes, the errors of four curves with a little noise, and what their legend claims: one claim is wrong."""
    generator = np.random.default_rng([seed, 11])
    x = np.array([100.0, 316, 1000, 3162, 10_000, 31_623])
    claimed = generator.permutation([-1.0, -0.5, -1 / 3, -0.25])
    true = claimed.copy()
    wrong = generator.integers(4)
    true[wrong] = generator.choice([value for value in (-0.75, -0.2, -0.6) if abs(value - claimed[wrong]) > 0.11])
    heights = 10 ** generator.uniform(-1, 1, 4)
    errors = heights[:, None] * (x / 1000) ** true[:, None] * np.exp(0.03 * generator.normal(size=(4, len(x))))
    return torch.from_numpy(x), torch.from_numpy(errors), torch.from_numpy(claimed)


def _drawn_case(seed: int) -> Case:
    return Case(f"plot {seed + 1}", drawn_curves(seed))


def _fits(x: Tensor, errors: Tensor) -> Tensor:
    gaps = x.log() - x.log().mean()
    return (errors.log() * gaps).sum(dim=1) / gaps.square().sum()


def _wrong(x: Tensor, errors: Tensor, claimed: Tensor) -> int:
    return int((_fits(x, errors) - claimed).abs().argmax())


def mean_gap(function: object) -> None:
    """Check ``function(share, n_points)``: E|F_m(y) − F(y)| exactly, where F(y) is the share."""
    mistakes = [
        Mistake(
            lambda f, m: math.sqrt(f * (1 - f) / m), "that is the bound, the root of the mean square; not the mean"
        ),
        Mistake(
            lambda f, m: math.sqrt(2 / math.pi * f * (1 - f) / m),
            "that is the limit for many points; for few, sum over the binomial distribution",
        ),
        Mistake(lambda f, m: m * _gap(f, m), "that is the gap of the number of points below y; F_m divides it by m"),
        Mistake(lambda f, m: 0.0, "signed gaps cancel: take their absolute values before the sum"),
        Mistake(lambda f, m: f * (1 - f) / m, "that is the variance of F_m(y)"),
    ]
    pairs = [(0.5, 1), (0.5, 2), (0.25, 10), (0.9, 7), (0.01, 100), (0.5, 500), (0.0, 5), (1.0, 5)]
    cases = [Case(f"F(y) = {share} and {m} points", (share, m)) for share, m in pairs]
    check_answer(function, _gap, cases, mistakes, "mean_gap")


def _gap(share: float, n_points: int) -> float:
    return sum(
        math.comb(n_points, k) * share**k * (1 - share) ** (n_points - k) * abs(k / n_points - share)
        for k in range(n_points + 1)
    )
