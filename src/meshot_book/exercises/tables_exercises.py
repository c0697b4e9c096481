"""Chapter 38: systems in the same order, who is better by an interval, and the best motion between two surfaces."""

import itertools

import numpy as np
import scipy.stats
import torch

from meshot.types import Float, Tensor
from meshot_book.exercises.verdict import Case, Mistake, check_answer


def same_order(function: object) -> None:
    """Check ``function(printed, ours)``: the share of all pairs of systems that both tables put in the same order."""
    mistakes = [
        Mistake(
            lambda p, o: 2 * _same(p, o) - 1,
            "this is Kendall's τ, which also subtracts the pairs in the opposite order; here a share is asked for",
        ),
        Mistake(
            lambda p, o: float(np.mean(np.argsort(np.argsort(p)) == np.argsort(np.argsort(o)))),
            "this counts systems with the same rank; compare each system with each other one",
        ),
        Mistake(
            lambda p, o: float(np.mean([_agree(p, o, i, i + 1) for i in range(len(p) - 1)])),
            "only neighbours in the list are compared; there are n (n − 1) / 2 pairs",
        ),
        Mistake(lambda p, o: 1 - _same(p, o), "this is the share of pairs in the opposite order"),
        Mistake(
            lambda p, o: _same(p, o) * len(p) * (len(p) - 1) / 2, "a share is needed: divide by the number of pairs"
        ),
    ]
    printed = [0.390, 0.346, 0.271, 0.234, 0.202]
    cases = [
        Case("five systems in the same order", (printed, [0.61, 0.52, 0.5, 0.3, 0.2])),
        Case("the best system of five last", (printed, [0.5, 0.45, 0.4, 0.3, 0.6])),
        Case("two neighbours exchanged", (printed, [0.5, 0.45, 0.35, 0.4, 0.3])),
        Case("two systems", (printed[:2], [0.2, 0.4])),
    ]
    check_answer(function, _same, cases, mistakes, "same_order")


def _agree(printed: list[float], ours: list[float], one: int, other: int) -> bool:
    return (printed[one] - printed[other]) * (ours[one] - ours[other]) > 0


def _same(printed: list[float], ours: list[float]) -> float:
    pairs = itertools.combinations(range(len(printed)), 2)
    return float(np.mean([_agree(printed, ours, *pair) for pair in pairs]))


def who_is_better(function: object) -> None:
    """Check ``function(ours, other, larger_is_better)``: 1 for ours, −1 for the other, 0 where it is undecided."""
    mistakes = [
        Mistake(
            lambda a, b, larger: _better(a, b, larger, _of_groups),
            "this is the interval of two independent groups; the same subjects are in both: use their differences",
        ),
        Mistake(
            lambda a, b, larger: _better(a, b, larger, _of_a_normal),
            "1.96 belongs to a normal distribution; with few subjects the quantile of Student's t is larger",
        ),
        Mistake(
            lambda a, b, larger: _better(a, b, False),
            "the answer does not depend on larger_is_better: of normals, a larger value is better",
        ),
        Mistake(
            lambda a, b, larger: -_better(a, b, larger), "the sign is reversed: 1 if the first system, ours, is better"
        ),
        Mistake(
            lambda a, b, larger: 1 if (a.mean() > b.mean()) == larger else -1,
            "this compares the means only; where the interval contains zero, nothing is decided",
        ),
    ]
    base = torch.tensor([0.21, 0.35, 0.28, 0.50, 0.41, 0.30], dtype=torch.float64)
    small = torch.tensor([0.02, 0.03, 0.01, 0.02, 0.03, 0.02], dtype=torch.float64)
    four = torch.tensor([0.05, 0.2, 0.12, 0.01], dtype=torch.float64)
    cases = [
        Case("a distance that is always smaller", (base - small, base, False)),
        Case("a distance that is always larger", (base + small, base, False)),
        Case("normals that are always larger", (base + small, base, True)),
        Case("four subjects that scatter", (base[:4] + four, base[:4], False)),
        Case("differences of both signs", (base + small - small.mean() - 1e-4, base, True)),
    ]
    check_answer(function, _better, cases, mistakes, "who_is_better")


def _paired(ours: np.ndarray, other: np.ndarray) -> float:
    differences = ours - other
    quantile = scipy.stats.t.ppf(0.975, len(differences) - 1)
    return quantile * differences.std(ddof=1) / np.sqrt(len(differences))


def _of_a_normal(ours: np.ndarray, other: np.ndarray) -> float:
    return 1.96 * (ours - other).std(ddof=1) / np.sqrt(len(ours))


def _of_groups(ours: np.ndarray, other: np.ndarray) -> float:
    quantile = scipy.stats.t.ppf(0.975, 2 * len(ours) - 2)
    return quantile * np.sqrt((ours.var(ddof=1) + other.var(ddof=1)) / len(ours))


def _better(
    ours: Float[Tensor, " n"], other: Float[Tensor, " n"], larger_is_better: bool, half_width: object = _paired
) -> int:
    first, second = ours.numpy(), other.numpy()
    gap = first.mean() - second.mean()
    if abs(gap) <= half_width(first, second):
        return 0
    return 1 if (gap > 0) == larger_is_better else -1


def best_motion(function: object) -> None:
    """Check ``function(moving, fixed)``: rotation and translation (3, 4) with the least squared distances."""
    mistakes = [
        Mistake(
            lambda m, f: _motion(m, f, proper=False),
            "on some points this is a reflection (determinant −1); there, change the sign of the last singular vector",
        ),
        Mistake(
            lambda m, f: _motion(m, f, centred=False),
            "the rotation is that of the points as they are; subtract the mean of each set before the singular values",
        ),
        Mistake(lambda m, f: _motion(f, m), "this moves the fixed points onto the moving ones"),
        Mistake(
            lambda m, f: _transposed(_motion(m, f), m, f),
            "the rotation is transposed: fixed ≈ R moving + t for columns, which is moving Rᵀ + t for rows",
        ),
        Mistake(
            lambda m, f: torch.cat([_motion(m, f)[:, :3], (f.mean(dim=0) - m.mean(dim=0))[:, None]], dim=1),
            "the translation is that without a rotation; the mean of the moving points is rotated, too",
        ),
    ]
    random = np.random.default_rng(3)
    points = torch.from_numpy(random.normal(size=(12, 3)) * [3.0, 2.0, 1.0] + [1.0, -2.0, 0.5])
    turn = torch.from_numpy(scipy.stats.special_ortho_group.rvs(3, random_state=4))
    noise = torch.from_numpy(random.normal(0, 0.1, (12, 3)))
    shift = torch.tensor([0.4, 1.0, -2.0], dtype=torch.float64)
    cases = [
        Case("a motion without noise", (points, points @ turn.T + shift)),
        Case("a motion with noise", (points, points @ turn.T + shift + noise)),
        Case("mirrored points", (points, points * points.new_tensor([1.0, 1.0, -1.0]) + shift)),
        Case("points that do not move", (points, points.clone())),
    ]
    check_answer(function, _motion, cases, mistakes, "best_motion")


def _motion(
    moving: Float[Tensor, "n 3"], fixed: Float[Tensor, "n 3"], proper: bool = True, centred: bool = True
) -> Float[Tensor, "3 4"]:
    here, there = moving.mean(dim=0), fixed.mean(dim=0)
    left, _, right = torch.linalg.svd((fixed - there * centred).T @ (moving - here * centred))
    signs = torch.ones(3, dtype=moving.dtype)
    signs[2] = torch.linalg.det(left @ right).sign() if proper else 1.0
    rotation = left @ torch.diag(signs) @ right
    return torch.cat([rotation, (there - rotation @ here)[:, None]], dim=1)


def _transposed(motion: Tensor, moving: Tensor, fixed: Tensor) -> Tensor:
    rotation = motion[:, :3].T
    return torch.cat([rotation, (fixed.mean(dim=0) - rotation @ moving.mean(dim=0))[:, None]], dim=1)
