"""The exercises of chapter 13: truths from elsewhere, and a different hint for each usual mistake."""

import math

import numpy as np
import pytest
import torch
from scipy import stats

from meshot import DiscreteMeasure, empirical, slice_costs
from meshot.loss import chamfer
from meshot.mesh import face_areas, folded_sphere
from meshot_book.exercises import check
from meshot_book.exercises.beyond_exercises import _floor


def by_disc(area, m, n):
    """The mean of r² where the chance to find nobody within r is exp(−π r² m / area)."""
    return sum(stats.expon(scale=area / (math.pi * k)).mean() for k in (m, n))


def by_package(source, target, directions):
    t = target.mean(dim=0) - source.mean(dim=0)
    costs = slice_costs(DiscreteMeasure(source + t), DiscreteMeasure(target), directions, 2)
    return float((t @ t) / len(t) + costs.mean())


def by_skellam(a, gap, m, p):
    law = stats.binom(m, a)
    if a in (0, 1):
        return 0.0
    k = np.arange(m + 1)
    joint = law.pmf(k)[:, None] * law.pmf(k)[None]
    return gap**p * float((joint * np.abs(k[:, None] - k[None])).sum()) / m


@pytest.mark.parametrize(
    ("checker", "function"),
    [(check.chamfer_floor, by_disc), (check.centred_cost, by_package), (check.gap_cost, by_skellam)],
)
def test_independent_solutions_pass(capsys, checker, function):
    checker(function)
    assert capsys.readouterr().out.startswith("✓")


def test_the_floor_is_that_of_samples():
    folded, generator = folded_sphere(3, 40.0, 6.0), np.random.default_rng(0)
    area = float(face_areas(folded).sum())
    draws = [float(chamfer(empirical(folded, 500, generator), empirical(folded, 4000, generator))) for _ in range(10)]
    assert np.mean(draws) == pytest.approx(_floor(area, 500, 4000), rel=0.05)


def parts(x, y, u):
    t = y.mean(dim=0) - x.mean(dim=0)
    shape = by_package(x, y, u) - float(t @ t) / len(t)
    return float(t @ t), len(t), shape


def plain(x, y, u):
    return float(slice_costs(DiscreteMeasure(x), DiscreteMeasure(y), u, 2).mean())


def unsorted(x, y, u):
    gaps = (x - x.mean(dim=0) - y + y.mean(dim=0)) @ u.T
    return parts(x, y, u)[0] / x.shape[1] + float(gaps.square().mean())


MISTAKES = {
    "chamfer_floor": {
        "both means use m": lambda a, m, n: by_disc(a, m, m),
        "both means use n": lambda a, m, n: by_disc(a, n, n),
        "each with its own": lambda a, m, n: by_disc(a, m + n, m + n),
        "not averaged": lambda a, m, n: by_disc(a, m, n) / 2,
        "π times r²": lambda a, m, n: math.pi * by_disc(a, m, n),
        "takes their squares": lambda a, m, n: math.sqrt(a / math.pi / m) + math.sqrt(a / math.pi / n),
        "one of the two": lambda a, m, n: a / math.pi / n,
    },
    "centred_cost": {
        "the plain estimate": plain,
        "the mean part is missing": lambda x, y, u: parts(x, y, u)[2],
        "is not |t|²": lambda x, y, u: parts(x, y, u)[0] + parts(x, y, u)[2],
        "divided by 3": lambda x, y, u: parts(x, y, u)[0] / 3 + parts(x, y, u)[2],
        "counted twice": lambda x, y, u: parts(x, y, u)[0] / x.shape[1] + plain(x, y, u),
        "sort both sides": unsorted,
        "has the mass 1/m": lambda x, y, u: parts(x, y, u)[0] / x.shape[1] + len(x) * parts(x, y, u)[2],
        "no root": lambda x, y, u: by_package(x, y, u) ** 0.5,
    },
    "gap_cost": {
        "both sides are sampled": lambda a, g, m, p: (
            g**p * stats.binom(m, a).expect(lambda k: abs(k / m - a)) if 0 < a < 1 else 0.0
        ),
        "the mass 1/m": lambda a, g, m, p: m * by_skellam(a, g, m, p),
        "to the power p": lambda a, g, m, p: by_skellam(a, g, m, 1),
        "no root": lambda a, g, m, p: by_skellam(a, g, m, p) ** (1 / p),
        "mean absolute value is smaller": lambda a, g, m, p: g**p * (2 * a * (1 - a) / m) ** 0.5,
        "for many points": lambda a, g, m, p: g**p * (4 * a * (1 - a) / m / math.pi) ** 0.5,
        "count it once": lambda a, g, m, p: 2 * by_skellam(a, g, m, p),
        "cancel": lambda a, g, m, p: 0.0,
    },
}


@pytest.mark.parametrize(
    ("name", "words"), [(name, words) for name, mistakes in MISTAKES.items() for words in mistakes]
)
def test_each_mistake_has_its_hint(hinted, name, words):
    hinted(getattr(check, name), MISTAKES[name][words], words)


def test_both_clouds_may_lie_anywhere():
    generator = np.random.default_rng(0)
    x, y = (torch.from_numpy(generator.normal(size=(6, 3))) for _ in range(2))
    u = torch.eye(3, dtype=torch.float64)
    # Along a whole orthonormal frame the plain estimate takes the mean part exactly as well.
    assert plain(x, y + 5, u) == pytest.approx(by_package(x, y + 5, u))
