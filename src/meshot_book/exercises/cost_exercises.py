"""Chapter 12: cells of a merge, exponents from a table, and nearest neighbours in bounded memory."""

from collections.abc import Callable, Sequence

import numpy as np
import torch

from meshot.types import Float, Tensor
from meshot_book.exercises.verdict import Case, Mistake, check_answer

Distances = Callable[[Tensor, Tensor], Tensor]


def merged_cells(function: object) -> None:
    """Check ``function(masses, others)``: on how many cells of the merged quantile functions both are constant.

    Masses are whole numbers with the same total on both sides, so that jumps at one place are exactly so.
    """
    mistakes = [
        Mistake(lambda a, b: len(a) + len(b), "the last steps of both sides end at the same place: count it once"),
        Mistake(
            lambda a, b: len(a) + len(b) - 1,
            "right unless both sides end a step at the same place; such a place is one end, not two",
        ),
        Mistake(lambda a, b: len(a) * len(b), "a merge visits every step once; it does not compare all pairs"),
        Mistake(
            lambda a, b: max(len(a), len(b)), "that would need every end of the shorter side to be one of the longer"
        ),
        Mistake(lambda a, b: len(_ends(a) & _ends(b)), "these are the places where both end; count where either does"),
        Mistake(
            lambda a, b: len(_ends(a) ^ _ends(b)),
            "places where steps of both sides end are missing: they end a cell too",
        ),
        Mistake(
            lambda a, b: len(set(a) | set(b)), "the masses are lengths of steps; add them up to get where steps end"
        ),
        Mistake(lambda a, b: _n_cells(a, b) + 1, "one too many: zero begins the first cell and ends none"),
    ]
    cases = [
        Case("three steps and two", ([1, 1, 1], [1, 2])),
        Case("four equal steps on both sides", ([2, 2, 2, 2], [2, 2, 2, 2])),
        Case("ends that coincide only at the total mass", ([3, 4], [2, 3, 2])),
        Case("one step and five", ([10], [1, 2, 3, 2, 2])),
        Case("one step each", ([7], [7])),
        Case("six steps and four", ([1, 5, 2, 2, 4, 6], [6, 3, 1, 10])),
        Case("the same masses in another order", ([1, 2, 3, 4], [4, 3, 2, 1])),
    ]
    check_answer(function, _n_cells, cases, mistakes, "merged_cells")


def _ends(masses: Sequence[int]) -> set[int]:
    return {int(end) for end in np.cumsum(masses)}


def _n_cells(masses: Sequence[int], others: Sequence[int]) -> int:
    return len(_ends(masses) | _ends(others))


def growth_exponent(function: object) -> None:
    """Check ``function(sizes, seconds)``: the exponent of a power law, by least squares on logarithms."""
    mistakes = [
        Mistake(
            lambda m, s: 1 / _exponent(m, s), "the quotient is inverted: the slope is of log seconds over log sizes"
        ),
        Mistake(lambda m, s: float(np.polyfit(m, s, 1)[0]), "this is the slope of seconds over sizes; take logarithms"),
        Mistake(lambda m, s: float(np.polyfit(m, np.log(s), 1)[0]), "the sizes need a logarithm too"),
        Mistake(lambda m, s: float(np.polyfit(np.log(m), s, 1)[0]), "the seconds need a logarithm too"),
        Mistake(
            lambda m, s: float(np.log(s[-1] / s[0]) / np.log(m[-1] / m[0])),
            "that is the line through the first and the last row; use all of them (least squares)",
        ),
        Mistake(
            lambda m, s: float((np.log(m) * np.log(s)).sum() / (np.log(m) ** 2).sum()),
            "the power law has a constant factor: fit an intercept as well as a slope",
        ),
        Mistake(
            lambda m, s: float(np.exp(np.polyfit(np.log(m), np.log(s), 1)[1])),
            "this is the factor in front of the power; the exponent is the other coefficient",
        ),
    ]
    noise = np.exp(0.2 * np.random.default_rng(0).standard_normal(5))
    sizes = np.array([1e3, 3e3, 1e4, 3e4, 1e5])
    tables = {
        "a quadratic table": (sizes, 4e-9 * sizes**2),
        "a linear table": (sizes[:3], 5e-6 * sizes[:3]),
        "a table with noise": (sizes, 1e-7 * sizes**1.3 * noise),
        "m log m": (sizes, 1e-7 * sizes * np.log(sizes)),
        "two rows": (sizes[1:3], np.array([0.5, 0.7])),
    }
    cases = [Case(name, tuple(column.tolist() for column in columns)) for name, columns in tables.items()]
    check_answer(function, _exponent, cases, mistakes, "growth_exponent")


def _exponent(sizes: Sequence[float], seconds: Sequence[float]) -> float:
    return float(np.polyfit(np.log(sizes), np.log(seconds), 1)[0])


def blocked_chamfer(function: object) -> None:
    """Check ``function(points, targets, distances, limit)``: Chamfer with at most ``limit`` distances at once.

    ``distances(points, targets)`` returns squared distances, and refuses to make more than it is allowed.
    """
    mistakes = [
        Mistake(lambda x, y, s, k: _mean_nearest(x, y), "one direction only: add that from the targets to the points"),
        Mistake(lambda x, y, s, k: _mean_nearest(y, x), "one direction only: add that from the points to the targets"),
        Mistake(
            lambda x, y, s, k: len(x) * _mean_nearest(x, y) + len(y) * _mean_nearest(y, x),
            "these are sums; the loss takes the mean of either side",
        ),
        Mistake(
            lambda x, y, s, k: (len(x) * _mean_nearest(x, y) + len(y) * _mean_nearest(y, x)) / (len(x) + len(y)),
            "one mean over both sides; the loss adds two means, each over its own side",
        ),
        Mistake(
            lambda x, y, s, k: _whole_blocks(x, y, k) + _whole_blocks(y, x, k),
            "the last block, which is not full, is left out",
        ),
        Mistake(
            lambda x, y, s, k: _mean_of_blocks(x, y, k) + _mean_of_blocks(y, x, k),
            "a mean of the blocks' means: the blocks have different lengths; add up all distances and divide once",
        ),
        Mistake(
            lambda x, y, s, k: _root_nearest(x, y) + _root_nearest(y, x),
            "the loss uses squared distances: take no root",
        ),
    ]
    generator = np.random.default_rng(2)
    x, y = (torch.from_numpy(generator.normal(size=(n, 3))) for n in (11, 7))
    cases = [
        Case("11 points, 7 targets, 28 distances at once", (x, y, _allowing(28), 28)),
        Case("7 points, 11 targets, 23 distances at once", (y, x, _allowing(23), 23)),
        Case("room for everything", (x, y, _allowing(77), 77)),
        Case("room for one row", (x, y, _allowing(11), 11)),
        Case("one point and one target", (x[:1], y[:1], _allowing(1), 1)),
        Case("points in the plane", (x[:, :2].clone(), y[:, :2].clone(), _allowing(30), 30)),
    ]
    check_answer(
        function, lambda x, y, s, k: _mean_nearest(x, y) + _mean_nearest(y, x), cases, mistakes, "blocked_chamfer"
    )


def _allowing(limit: int) -> Distances:
    """Squared distances, up to ``limit`` of them in one call."""

    def distances(points: Tensor, targets: Tensor) -> Tensor:
        if len(points) * len(targets) > limit:
            raise ValueError(f"{len(points)} × {len(targets)} distances asked for at once, {limit} are allowed")
        return (points[:, None] - targets[None]).square().sum(dim=2)

    return distances


def _nearest(points: Float[Tensor, "n d"], targets: Float[Tensor, "m d"]) -> Float[Tensor, " n"]:
    return (points[:, None] - targets[None]).square().sum(dim=2).min(dim=1).values


def _mean_nearest(points: Tensor, targets: Tensor) -> float:
    return float(_nearest(points, targets).mean())


def _root_nearest(points: Tensor, targets: Tensor) -> float:
    return float(_nearest(points, targets).sqrt().mean())


def _whole_blocks(points: Tensor, targets: Tensor, limit: int) -> float:
    rows = max(1, limit // len(targets))
    return float(_nearest(points, targets)[: len(points) // rows * rows].sum() / len(points))


def _mean_of_blocks(points: Tensor, targets: Tensor, limit: int) -> float:
    blocks = _nearest(points, targets).split(max(1, limit // len(targets)))
    return float(torch.stack([block.mean() for block in blocks]).mean())
