"""The exercises of chapter 33: independent solutions pass, and each usual mistake gets its own hint."""

import math
from fractions import Fraction

import numpy as np
import pytest
import torch

from meshot.metrics.distances import Offsets, average_surface_distance, hausdorff_distance
from meshot_book.exercises import check


def by_geometry(value, floor):
    """The other leg of a right triangle."""
    return value * math.sin(math.acos(min(1.0, floor / value)))


def by_the_ruler(there, back):
    sides = [Offsets(x.numpy(), np.ones(len(x))) for x in (there, back)]
    return torch.tensor([average_surface_distance(*sides), hausdorff_distance(*sides)])


def by_fractions(percent, n_faces, n_scans):
    k = 0
    while Fraction(200 * (k + 1), n_faces * n_scans) < Fraction(percent):
        k += 1
    return k


def by_squares(emd, swd, written):
    squared_emd = {"roots": emd**2, "squares": emd, "half": 2 * emd}[written]
    squared_swd = swd**2 if written == "roots" else swd
    return 3 * squared_swd > squared_emd


SOLUTIONS = {
    "without_floor": by_geometry,
    "two_sided": by_the_ruler,
    "pairs_left": by_fractions,
    "breaks_bound": by_squares,
}


@pytest.mark.parametrize("name", SOLUTIONS)
def test_independent_solutions_pass(capsys, name):
    getattr(check, name)(SOLUTIONS[name])
    assert capsys.readouterr().out.startswith("✓")


def scores(assd, hd):
    return torch.stack([torch.as_tensor(assd), torch.as_tensor(hd)])


MISTAKES = {
    "without_floor": {
        "do not subtract": lambda v, f: v - f,
        "take the root": lambda v, f: max(0.0, v * v - f * f),
        "a ratio": lambda v, f: v / f,
        "a value below the floor is due to chance": lambda v, f: abs(v * v - f * f) ** 0.5,
        "the sign is wrong": lambda v, f: math.hypot(v, f),
    },
    "two_sided": {
        "average each side first": lambda a, b: scores(torch.cat([a, b]).mean(), by_the_ruler(a, b)[1]),
        "averaged, not added": lambda a, b: by_the_ruler(a, b) * torch.tensor([2.0, 1.0]),
        "all distances together": lambda a, b: scores(by_the_ruler(a, b)[0], torch.cat([a, b]).quantile(0.9)),
        "not their mean": lambda a, b: scores(by_the_ruler(a, b)[0], (a.quantile(0.9) + b.quantile(0.9)) / 2),
        "not the smaller": lambda a, b: scores(by_the_ruler(a, b)[0], min(a.quantile(0.9), b.quantile(0.9))),
        "at 100 %": lambda a, b: scores(by_the_ruler(a, b)[0], max(a.max(), b.max())),
        "only one side": lambda a, b: scores(a.mean(), a.quantile(0.9)),
    },
    "pairs_left": {
        "the share is in per cent": lambda p, f, n: p * f * n // 2,
        "this counts faces": lambda p, f, n: p * f * n // 100,
        "over all scans": lambda p, f, n: p * f // 200,
        "the number of pairs must be whole": lambda p, f, n: p * f * n / 200,
        "rounded up": lambda p, f, n: math.ceil(p * f * n / 200),
        "not fewer": lambda p, f, n: p * f // (200 * n),
    },
    "breaks_bound": {
        "the factor 1/3 of the bound is missing": lambda e, s, w: s > e,
        "look at": lambda e, s, w: s * 3**0.5 > e,
        "another bound": lambda e, s, w: 3 * s > e,
        "true where the row violates the bound": lambda e, s, w: ~by_squares(e, s, w),
        "wider, not narrower": lambda e, s, w: by_squares(e, s, w) if w != "half" else 6 * s > e,
        "twice the number": lambda e, s, w: by_squares(e, s, w) if w != "half" else 3 * s > e,
        "the two columns are exchanged": lambda e, s, w: s * {"roots": 3**-0.5, "squares": 1 / 3, "half": 2 / 3}[w] > e,
    },
}  # fmt: skip


@pytest.mark.parametrize(
    ("name", "words"), [(name, words) for name, mistakes in MISTAKES.items() for words in mistakes]
)
def test_each_mistake_has_its_hint(hinted, name, words):
    hinted(getattr(check, name), MISTAKES[name][words], words)


def test_a_complex_length_is_refused(capsys):
    check.without_floor(lambda value, floor: (value * value - floor * floor) ** 0.5)
    assert "it returns complex numbers" in capsys.readouterr().out
