"""The exercises of chapter 12: truths from elsewhere, and a different hint for each usual mistake."""

import itertools

import numpy as np
import pytest
import scipy.spatial
import scipy.stats
import torch

from meshot_book.exercises import check


def cells_by_walking(masses, others):
    """Two pointers, each with what is left of its step."""
    i = j = cells = 0
    left, right = masses[0], others[0]
    while True:
        step = min(left, right)
        left, right, cells = left - step, right - step, cells + 1
        if not left:
            i += 1
        if not right:
            j += 1
        if i == len(masses):
            return cells
        left, right = left or masses[i], right or others[j]


def exponent_by_scipy(sizes, seconds):
    return scipy.stats.linregress(np.log(sizes), np.log(seconds)).slope


def rows_one_by_one(points, targets, distances, limit):
    there = [distances(x[None], targets).min() for x in points]
    back = [distances(y[None], points).min() for y in targets]
    return sum(there) / len(there) + sum(back) / len(back)


def chamfer_by_tree(points, targets, distances, limit):
    there, _ = scipy.spatial.KDTree(targets).query(points)
    back, _ = scipy.spatial.KDTree(points).query(targets)
    return (there**2).mean() + (back**2).mean()


@pytest.mark.parametrize(
    ("checker", "function"),
    [
        (check.merged_cells, cells_by_walking),
        (check.growth_exponent, exponent_by_scipy),
        (check.blocked_chamfer, rows_one_by_one),
        (check.blocked_chamfer, chamfer_by_tree),
    ],
)
def test_independent_solutions_pass(capsys, checker, function):
    checker(function)
    assert capsys.readouterr().out.startswith("✓")


def all_at_once(points, targets, distances, limit):
    squared = distances(points, targets)
    return squared.min(dim=1).values.mean() + squared.min(dim=0).values.mean()


def in_blocks(x, y, s, k, full_only=False):
    rows = k // len(y)
    blocks = [block for block in x.split(rows) if len(block) == rows or not full_only]
    return torch.cat([s(block, y).min(dim=1).values for block in blocks])


def both_ways(one_way):
    return lambda x, y, s, k: one_way(x, y, s, k) + one_way(y, x, s, k)


WRONG = {
    "count it once": (check.merged_cells, lambda a, b: len(a) + len(b)),
    "unless both sides end": (check.merged_cells, lambda a, b: len(a) + len(b) - 1),
    "all pairs": (check.merged_cells, lambda a, b: len(a) * len(b)),
    "shorter side": (check.merged_cells, lambda a, b: max(len(a), len(b))),
    "where both end; count": (
        check.merged_cells,
        lambda a, b: len(set(itertools.accumulate(a)) & set(itertools.accumulate(b))),
    ),
    "they end a cell too": (
        check.merged_cells,
        lambda a, b: len(set(itertools.accumulate(a)) ^ set(itertools.accumulate(b))),
    ),
    "lengths of steps": (check.merged_cells, lambda a, b: len({*a, *b})),
    "one too many": (check.merged_cells, lambda a, b: cells_by_walking(a, b) + 1),
    "the quotient is inverted": (check.growth_exponent, lambda m, s: 1 / exponent_by_scipy(m, s)),
    "take logarithms": (check.growth_exponent, lambda m, s: scipy.stats.linregress(m, s).slope),
    "sizes need": (check.growth_exponent, lambda m, s: scipy.stats.linregress(m, np.log(s)).slope),
    "seconds need": (check.growth_exponent, lambda m, s: scipy.stats.linregress(np.log(m), s).slope),
    "first and the last": (check.growth_exponent, lambda m, s: np.log2(s[-1] / s[0]) / np.log2(m[-1] / m[0])),
    "fit an intercept": (check.growth_exponent, lambda m, s: np.linalg.lstsq(np.log(m)[:, None], np.log(s))[0][0]),
    "other coefficient": (
        check.growth_exponent,
        lambda m, s: np.exp(scipy.stats.linregress(np.log(m), np.log(s)).intercept),
    ),
    "are allowed": (check.blocked_chamfer, all_at_once),
    "from the targets to": (check.blocked_chamfer, lambda x, y, s, k: in_blocks(x, y, s, k).mean()),
    "from the points to": (check.blocked_chamfer, lambda x, y, s, k: in_blocks(y, x, s, k).mean()),
    "sums": (check.blocked_chamfer, both_ways(lambda x, y, s, k: in_blocks(x, y, s, k).sum())),
    "each over its own": (
        check.blocked_chamfer,
        lambda x, y, s, k: torch.cat([in_blocks(x, y, s, k), in_blocks(y, x, s, k)]).mean(),
    ),
    "not full": (check.blocked_chamfer, both_ways(lambda x, y, s, k: in_blocks(x, y, s, k, True).sum() / len(x))),
    "a mean of the blocks' means": (
        check.blocked_chamfer,
        both_ways(
            lambda x, y, s, k: torch.stack([s(b, y).min(dim=1).values.mean() for b in x.split(k // len(y))]).mean()
        ),
    ),
    "no root": (check.blocked_chamfer, both_ways(lambda x, y, s, k: in_blocks(x, y, s, k).sqrt().mean())),
}


@pytest.mark.parametrize("hint", WRONG)
def test_mistakes_get_their_hint(hinted, hint):
    checker, function = WRONG[hint]
    hinted(checker, function, hint)
