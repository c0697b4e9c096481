"""The exercises of chapter 11: truths from elsewhere, and a different hint for each usual mistake."""

import math

import numpy as np
import pytest
from scipy import stats

from meshot_book.exercises import check
from meshot_book.exercises.convergence_exercises import drawn_curves
from meshot_book.statistics import fitted_slope


def by_search(p, joint, first, second, tolerance):
    """Count up until the bound is low enough: no square, no rounding."""
    steep = p * joint ** (p - 1) * (first + second)
    m = 1
    while steep / (2 * math.sqrt(m)) > tolerance:
        m += 1
    return m


def by_fits(x, errors, claimed):
    gaps = [
        abs(fitted_slope(x.tolist(), row[:, None].numpy()).slope - float(claim)) for row, claim in zip(errors, claimed)
    ]
    return int(np.argmax(gaps))


def by_scipy(share, n_points):
    law = stats.binom(n_points, share)
    return law.expect(lambda k: abs(k / n_points - share)) if 0 < share < 1 else 0.0


@pytest.mark.parametrize(
    ("checker", "function"),
    [(check.points_needed, by_search), (check.wrong_curve, by_fits), (check.mean_gap, by_scipy)],
)
def test_independent_solutions_pass(capsys, checker, function):
    checker(function)
    assert capsys.readouterr().out.startswith("✓")


def test_the_wrong_claim_stands_out_in_every_plot():
    for seed in range(12):
        x, errors, claimed = drawn_curves(seed)
        slopes = [np.polyfit(x.log(), row.log(), 1)[0] for row in errors]
        gaps = np.sort(np.abs(slopes - claimed.numpy()))
        assert gaps[-1] > 0.07 > 0.03 > gaps[-2]


def steep(p, joint, first, second, tolerance):
    return p * joint ** (p - 1) * (first + second) / (2 * tolerance)


def slopes(x, y):
    return np.polyfit(x, y.T, 1)[0]


POINTS = {
    "then square": lambda *a: math.ceil(steep(*a)),
    "round it up": lambda *a: steep(*a) ** 2,
    "just above the tolerance": lambda *a: int(steep(*a) ** 2),
    "power p − 1": lambda p, d, *a: math.ceil((d * steep(p, d, *a)) ** 2),
    "the factor p": lambda p, *a: math.ceil((steep(p, *a) / p) ** 2),
    "at most ½": lambda *a: math.ceil((2 * steep(*a)) ** 2),
    "its own diameter": lambda p, d, r, s, t: math.ceil(steep(p, d, d, d, t) ** 2),
    "distance between the supports": lambda p, d, r, s, t: math.ceil(steep(p, max(r, s), r, s, t) ** 2),
}
CURVE = {
    "since a constant factor does not change them": lambda x, e, c: int(e[:, 0].argmax()),
    "that is the curve with the largest last error": lambda x, e, c: int(e[:, -1].argmax()),
    "steepest": lambda x, e, c: int(slopes(np.log(x), np.log(e)).argmin()),
    "flattest curve": lambda x, e, c: int(slopes(np.log(x), np.log(e)).argmax()),
    "flattest claim": lambda x, e, c: int(c.argmax()),
    "and check the signs": lambda x, e, c: int(np.abs(slopes(np.log(x), np.log(e)) + c.numpy()).argmax()),
    "take logarithms of sizes and errors": lambda x, e, c: int(np.abs(slopes(x, np.log(e)) - c.numpy()).argmax()),
    "that is always the steepest claim": lambda x, e, c: int(np.abs(slopes(x, e) - c.numpy()).argmax()),
    "faster than it claims": lambda x, e, c: int((slopes(np.log(x), np.log(e)) - c.numpy()).argmax()),
}
GAP = {
    "that is the bound": lambda f, m: np.sqrt(f * (1 - f) / m),
    "for many points": lambda f, m: np.sqrt(2 * f * (1 - f) / (m * np.pi)),
    "divides it by m": lambda f, m: m * by_scipy(f, m),
    "cancel": lambda f, m: 0.0,
    "variance": lambda f, m: f * (1 - f) / m,
}


@pytest.mark.parametrize(
    ("checker", "words", "function"),
    [
        (getattr(check, name), words, function)
        for name, mistakes in (("points_needed", POINTS), ("wrong_curve", CURVE), ("mean_gap", GAP))
        for words, function in mistakes.items()
    ],
)
def test_each_mistake_has_its_hint(hinted, checker, words, function):
    hinted(checker, function, words)
