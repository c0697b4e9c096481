"""Chapter 13: the floor of Chamfer, a sliced loss whose mean part is known, and the price of a gap."""

import math

import numpy as np
import torch

from meshot.types import Float, Tensor
from meshot_book.exercises.verdict import Case, Mistake, check_answer


def chamfer_floor(function: object) -> None:
    """Check ``function(area, m, n)``: Chamfer between two samples of one surface of that area, to leading order."""
    mistakes = [
        Mistake(lambda a, m, n: 2 * a / (math.pi * m), "both means use m: the second sample has n points"),
        Mistake(lambda a, m, n: 2 * a / (math.pi * n), "both means use n: the first sample has m points"),
        Mistake(lambda a, m, n: 2 * a / (math.pi * (m + n)), "add the two means, each with its own number of points"),
        Mistake(lambda a, m, n: _floor(a, m, n) / 2, "the two means are added, not averaged"),
        Mistake(lambda a, m, n: a / m + a / n, "a / m is the area for each point; the disc around it has π times r²"),
        Mistake(
            lambda a, m, n: math.sqrt(a / (math.pi * m)) + math.sqrt(a / (math.pi * n)),
            "these are distances; Chamfer takes their squares",
        ),
        Mistake(lambda a, m, n: a / (math.pi * n), "one of the two means is missing"),
        Mistake(lambda a, m, n: a / (math.pi * m), "one of the two means is missing"),
    ]
    rows = {
        "equal samples of the unit sphere": (4 * math.pi, 100, 100),
        "ten times as many on one side": (20_000.0, 1000, 10_000),
        "a few points": (3.0, 7, 5),
    }
    check_answer(function, _floor, [Case(name, row) for name, row in rows.items()], mistakes, "chamfer_floor")


def _floor(area: float, m: int, n: int) -> float:
    return area / (math.pi * m) + area / (math.pi * n)


def centred_cost(function: object) -> None:
    """Check ``function(source, target, directions)``: SW₂² with the mean part taken exactly, the rest estimated."""
    mistakes = [
        Mistake(
            lambda x, y, u: _sliced(x, y, u),
            "this is the plain estimate: the mean part still depends on the directions",
        ),
        Mistake(lambda x, y, u: _shape(x, y, u), "the mean part is missing: add the mean of ⟨θ, t⟩² over the sphere"),
        Mistake(
            lambda x, y, u: _apart(x, y) + _shape(x, y, u),
            "the mean of ⟨θ, t⟩² over the sphere is not |t|²: each of the d coordinates of θ has the mean square 1/d",
        ),
        Mistake(
            lambda x, y, u: _apart(x, y) / 3 + _shape(x, y, u),
            "the mean part is divided by 3 in every space: use the number of columns",
        ),
        Mistake(
            lambda x, y, u: _apart(x, y) / x.shape[1] + _sliced(x, y, u),
            "the mean part is counted twice: centre both clouds before the projection",
        ),
        Mistake(
            lambda x, y, u: _apart(x, y) / x.shape[1] + _unsorted(x, y, u),
            "points are paired in their original order: sort both sides along every direction",
        ),
        Mistake(
            lambda x, y, u: _apart(x, y) / x.shape[1] + x.shape[0] * _shape(x, y, u),
            "the squared differences are added over the points; each point has the mass 1/m",
        ),
        Mistake(lambda x, y, u: _centred(x, y, u) ** 0.5, "SW₂² is asked for: no root"),
    ]
    check_answer(function, _centred, _cloud_cases(), mistakes, "centred_cost")


def _cloud_cases() -> list[Case]:
    generator = np.random.default_rng(0)

    def cloud(m: int, d: int, shift: float) -> Tensor:
        return torch.from_numpy(shift + generator.normal(size=(m, d)))

    def directions(n: int, d: int) -> Tensor:
        drawn = torch.from_numpy(generator.normal(size=(n, d)))
        return drawn / drawn.norm(dim=1, keepdim=True)

    return [
        Case("two clouds in space", (cloud(9, 3, 0.0), cloud(9, 3, 2.0), directions(4, 3))),
        Case("two clouds with normals", (cloud(12, 6, 0.0), cloud(12, 6, -1.0), directions(7, 6))),
        Case("two clouds in the plane", (cloud(5, 2, 1.0), cloud(5, 2, 1.5), directions(3, 2))),
        Case("one direction", (cloud(8, 3, 0.0), cloud(8, 3, 5.0), directions(1, 3))),
    ]


def _sliced(x: Float[Tensor, "m d"], y: Float[Tensor, "m d"], u: Float[Tensor, "L d"]) -> float:
    first, second = ((points @ u.T).sort(dim=0).values for points in (x, y))
    return float((first - second).square().mean())


def _shape(x: Float[Tensor, "m d"], y: Float[Tensor, "m d"], u: Float[Tensor, "L d"]) -> float:
    return _sliced(x - x.mean(dim=0), y - y.mean(dim=0), u)


def _unsorted(x: Float[Tensor, "m d"], y: Float[Tensor, "m d"], u: Float[Tensor, "L d"]) -> float:
    gaps = (x - x.mean(dim=0) - y + y.mean(dim=0)) @ u.T
    return float(gaps.square().mean())


def _apart(x: Float[Tensor, "m d"], y: Float[Tensor, "m d"]) -> float:
    return float((x.mean(dim=0) - y.mean(dim=0)).square().sum())


def _centred(x: Float[Tensor, "m d"], y: Float[Tensor, "m d"], u: Float[Tensor, "L d"]) -> float:
    return _apart(x, y) / x.shape[1] + _shape(x, y, u)


def gap_cost(function: object) -> None:
    """Check ``function(a, gap, m, p)``: E W_p^p between two samples of two points that are a gap apart, exactly."""
    mistakes = [
        Mistake(
            lambda a, gap, m, p: gap**p * _one_sided(a, m),
            "this compares one sample with the measure itself; here both sides are sampled",
        ),
        Mistake(lambda a, gap, m, p: m * _gap_cost(a, gap, m, p), "each point has the mass 1/m"),
        Mistake(
            lambda a, gap, m, p: gap * _surplus(a, m),
            "each unit of mass that crosses the gap costs the gap to the power p",
        ),
        Mistake(lambda a, gap, m, p: _gap_cost(a, gap, m, p) ** (1 / p), "W_p^p is asked for: no root"),
        Mistake(
            lambda a, gap, m, p: gap**p * math.sqrt(2 * a * (1 - a) / m),
            "that is the root of the mean square of the surplus; its mean absolute value is smaller",
        ),
        Mistake(
            lambda a, gap, m, p: gap**p * math.sqrt(4 * a * (1 - a) / (math.pi * m)),
            "that is the limit for many points; for few, sum over both binomial distributions",
        ),
        Mistake(
            lambda a, gap, m, p: 2 * _gap_cost(a, gap, m, p),
            "the surplus at one position equals the deficit at the other: count it once",
        ),
        Mistake(lambda a, gap, m, p: 0.0, "signed surpluses cancel: take their absolute values before the sum"),
    ]
    rows = {
        "halves, one point each": (0.5, 2.0, 1, 2),
        "halves, ten points": (0.5, 3.0, 10, 1),
        "unequal masses": (0.2, 1.5, 8, 2),
        "p = 3": (0.7, 2.0, 5, 3),
        "all mass at one position": (1.0, 4.0, 6, 2),
    }
    check_answer(function, _gap_cost, [Case(name, row) for name, row in rows.items()], mistakes, "gap_cost")


def _chances(a: float, m: int) -> list[float]:
    return [math.comb(m, k) * a**k * (1 - a) ** (m - k) for k in range(m + 1)]


def _one_sided(a: float, m: int) -> float:
    return sum(chance * abs(k / m - a) for k, chance in enumerate(_chances(a, m)))


def _surplus(a: float, m: int) -> float:
    """E|k − l|/m for two independent binomial numbers."""
    chances = _chances(a, m)
    return sum(p * q * abs(k - n) for k, p in enumerate(chances) for n, q in enumerate(chances)) / m


def _gap_cost(a: float, gap: float, m: int, p: float) -> float:
    return gap**p * _surplus(a, m)
