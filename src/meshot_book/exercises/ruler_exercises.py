"""Chapter 33: taking a floor out of a number, two sides of a distance, shares as counts, a table against itself."""

import math

import numpy as np
import torch

from meshot.types import Bool, Float, Tensor
from meshot_book.exercises.verdict import Case, Mistake, check_answer


def without_floor(function: object) -> None:
    """Check ``function(value, floor)``: what is left of a sampled W₂ when its floor is taken out."""
    mistakes = [
        Mistake(lambda v, f: v - f, "do not subtract the lengths: their squares add up"),
        Mistake(lambda v, f: max(v - f, 0.0), "do not subtract the lengths: their squares add up"),
        Mistake(
            lambda v, f: v**2 - f**2,
            "this is a squared length, in mm², and negative below the floor: return the root, and 0 below the floor",
        ),
        Mistake(lambda v, f: max(v**2 - f**2, 0.0), "this is a squared length, in mm²: take the root"),
        Mistake(lambda v, f: v / f, "a ratio says how far above the floor, not how many millimetres"),
        Mistake(
            lambda v, f: math.sqrt(abs(v**2 - f**2)),
            "a value below the floor is due to chance: return 0 there",
        ),
        Mistake(lambda v, f: math.sqrt(v**2 + f**2), "the sign is wrong: this adds the floor instead of removing it"),
    ]
    cases = [
        Case("3, 4, 5", (5.0, 4.0)),
        Case("a value far above its floor", (7.3, 0.2)),
        Case("a value barely above its floor", (1.21, 1.2)),
        Case("a value at its floor", (2.5, 2.5)),
        Case("a value below its floor", (1.1, 1.3)),
    ]
    check_answer(function, lambda v, f: math.sqrt(max(v**2 - f**2, 0.0)), cases, mistakes, "without_floor")


def two_sided(function: object) -> None:
    """Check ``function(there, back)``: ASSD and the Hausdorff distance at 90 %, from the distances of both sides."""
    both = torch.cat
    mistakes = [
        Mistake(
            lambda a, b: _pair(both([a, b]).mean(), _quantile(a, b)),
            "the side with more points counts more here: average each side first",
        ),
        Mistake(lambda a, b: _pair(a.mean() + b.mean(), _quantile(a, b)), "the two sides are averaged, not added"),
        Mistake(
            lambda a, b: _pair(max(a.mean(), b.mean()), _quantile(a, b)),
            "ASSD averages the sides; only HD takes the larger",
        ),
        Mistake(
            lambda a, b: _pair(_mean(a, b), both([a, b]).quantile(0.9)),
            "this is the quantile of all distances together: take the quantile of each side, then the larger one",
        ),
        Mistake(
            lambda a, b: _pair(_mean(a, b), (a.quantile(0.9) + b.quantile(0.9)) / 2),
            "HD takes the larger of the two quantiles, not their mean",
        ),
        Mistake(
            lambda a, b: _pair(_mean(a, b), min(a.quantile(0.9), b.quantile(0.9))), "the larger one, not the smaller"
        ),
        Mistake(lambda a, b: _pair(_mean(a, b), max(a.max(), b.max())), "this is the Hausdorff distance at 100 %"),
        Mistake(
            lambda a, b: _pair(a.mean(), a.quantile(0.9)),
            "only one side is used: a missing part appears only in the distances from the other side",
        ),
    ]
    draw = np.random.default_rng(0).exponential(size=500)
    numbers = torch.from_numpy(draw)
    cases = [
        Case("equal sides", (numbers[:40], numbers[:40].flip(0))),
        Case("sides of other sizes", (numbers[:300], 3 * numbers[300:350])),
        Case("an error that one side sees", (torch.cat([numbers[:80], numbers[:20] + 50]) / 10, numbers[:100] / 10)),
        Case("a perfect side", (torch.zeros(7, dtype=torch.float64), numbers[:9])),
    ]
    check_answer(function, lambda a, b: _pair(_mean(a, b), _quantile(a, b)), cases, mistakes, "two_sided")


def _mean(a: Float[Tensor, " n"], b: Float[Tensor, " m"]) -> Tensor:
    return (a.mean() + b.mean()) / 2


def _quantile(a: Float[Tensor, " n"], b: Float[Tensor, " m"]) -> Tensor:
    return max(a.quantile(0.9), b.quantile(0.9))


def _pair(first: object, second: object) -> Float[Tensor, " 2"]:
    return torch.stack([torch.as_tensor(first), torch.as_tensor(second)])


def pairs_left(function: object) -> None:
    """Check ``function(percent, n_faces, n_scans)``: how many crossing pairs a mean share below a bound can hide."""
    mistakes = [
        Mistake(lambda p, f, n: int(p * f * n / 2), "the share is in per cent: divide by 100"),
        Mistake(lambda p, f, n: int(p / 100 * f * n), "this counts faces; an intersecting pair has two faces"),
        Mistake(
            lambda p, f, n: int(p / 100 * f / 2), "the mean is over all scans: one of them may have all the crossings"
        ),
        Mistake(lambda p, f, n: p / 100 * f * n / 2, "the number of pairs must be whole"),
        Mistake(lambda p, f, n: math.ceil(p / 100 * f * n / 2), "rounded up, the share exceeds the bound: round down"),
        Mistake(lambda p, f, n: int(p / 100 * f / 2 / n), "more scans allow more pairs, not fewer"),
    ]
    cases = [
        Case("the paper's bound, one surface of 260 000 faces", (1e-4, 260_000, 1)),
        Case("the same as a mean over 80 scans", (1e-4, 260_000, 80)),
        Case("a coarse mesh", (0.01, 20_480, 3)),
        Case("a generous bound", (1.03, 335_872, 7)),
    ]
    check_answer(function, lambda p, f, n: int(p / 100 * f * n / 2), cases, mistakes, "pairs_left")


def breaks_bound(function: object) -> None:
    """Check ``function(emd, swd, written)``: which rows of a table break SW₂ ≤ W₂/√3, as the columns are written.

    ``written`` is "roots" (W₂ and SW₂), "squares" (W₂² and SW₂²) or "half" (½ W₂² and SW₂²).
    """
    mistakes = [
        Mistake(lambda e, s, w: s > e, "the factor 1/3 of the bound is missing: SW₂² ≤ W₂²/3"),
        Mistake(lambda e, s, w: s > e / math.sqrt(3), "squares and halves have other bounds; look at `written`"),
        Mistake(lambda e, s, w: s > e / 3, "roots have another bound: √(1/3)"),
        Mistake(lambda e, s, w: ~_breaks(e, s, w), "the answer is negated: true where the row violates the bound"),
        Mistake(
            lambda e, s, w: s > e * {"roots": 3**-0.5, "squares": 1 / 3, "half": 1 / 6}[w],
            "half of W₂² is given: W₂² is twice the number, so the bound is wider, not narrower",
        ),
        Mistake(
            lambda e, s, w: s > e * {"roots": 3**-0.5, "squares": 1 / 3, "half": 1 / 3}[w],
            "half of W₂² is given: W₂² is twice the number",
        ),
        Mistake(
            lambda e, s, w: s * {"roots": 3**-0.5, "squares": 1 / 3, "half": 2 / 3}[w] > e,
            "the two columns are exchanged",
        ),
    ]
    emd = torch.tensor([1.368, 1.051, 0.912, 0.803, 0.728, 0.425, 1.0, 0.6], dtype=torch.float64)
    swd = torch.tensor([1.357, 0.823, 0.525, 0.250, 0.420, 0.785, 0.5, 0.15], dtype=torch.float64)
    cases = [Case(f"columns written as {word}", (emd, swd, word)) for word in ("roots", "squares", "half")]
    check_answer(function, _breaks, cases, mistakes, "breaks_bound")


def _breaks(emd: Float[Tensor, " n"], swd: Float[Tensor, " n"], written: str) -> Bool[Tensor, " n"]:
    return swd > emd * {"roots": 1 / math.sqrt(3), "squares": 1 / 3, "half": 2 / 3}[written]
