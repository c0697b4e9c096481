"""Chapter 30: noise from air, the affine of a grid, and exact partial volume."""

import math

import numpy as np
import torch

from meshot.types import Float, Tensor
from meshot_book.exercises.verdict import Case, Mistake, check_answer


def noise_from_air(function: object) -> None:
    """Check ``function(values)``: σ of the noise in each channel, from magnitudes where there is no signal.

    By the second moment: the mean of the squared magnitude is 2 σ².
    """
    mistakes = [
        Mistake(
            lambda v: v.std(correction=0), "the standard deviation of a magnitude is .66 σ, not the σ of a channel"
        ),
        Mistake(lambda v: v.std(), "the standard deviation of a magnitude is .66 σ, not the σ of a channel"),
        Mistake(lambda v: (v**2).mean().sqrt(), "the squared magnitude is the sum of two channels: its mean is 2 σ²"),
        Mistake(lambda v: (v**2).mean() / 2, "this is σ²; σ has the unit of the signal"),
        Mistake(lambda v: v.mean(), "the mean of a magnitude is not σ, and here the second moment is asked for"),
        Mistake(
            lambda v: v.mean() / math.sqrt(math.pi / 2),
            "right in the limit, but from the first moment; use the mean of the squares, 2 σ²",
        ),
    ]
    rng = np.random.default_rng(0)
    cases = [Case("magnitudes that are all 1", (torch.ones(5, dtype=torch.float64),))]
    for sigma, shape in ((3.0, (400,)), (0.5, (7, 8, 9)), (12.0, (50,))):
        real, imaginary = (torch.from_numpy(sigma * rng.standard_normal(shape)) for _ in range(2))
        cases.append(Case(f"air of shape {shape} under noise of {sigma}", (torch.hypot(real, imaginary),)))
    check_answer(function, lambda v: ((v**2).mean() / 2).sqrt(), cases, mistakes, "noise_from_air")


def grid_affine(function: object) -> None:
    """Check ``function(extent_mm, shape, centre_mm)``: the affine of a grid whose box lies around a centre.

    The box is measured from the outer sides of its voxels; the axes of the grid are those of the world.
    """
    mistakes = [
        Mistake(
            lambda e, s, c: _affine(e / s, c - e / 2),
            "index 0 is the *middle* of the first voxel; the box begins half a voxel before it",
        ),
        Mistake(
            lambda e, s, c: _affine(e / (s - 1), c - e / 2),
            "n voxels are n sizes long from side to side, not n − 1; that would be from centre to centre",
        ),
        Mistake(
            lambda e, s, c: _affine(e / s, c + e / s * (s - 1) / 2), "the first voxel lies below the centre: subtract"
        ),
        Mistake(
            lambda e, s, c: _affine(e / s, c), "this puts the first voxel at the centre, not the middle of the box"
        ),
        Mistake(
            lambda e, s, c: _affine((e / s).mean().expand(3), c - (e / s).mean() * (s - 1) / 2),
            "the voxels are not cubes; each axis has its own size",
        ),
        Mistake(
            lambda e, s, c: _affine(s / e, c - s / e * (s - 1) / 2),
            "the quotient is inverted: size is extent divided by count",
        ),
    ]

    def case(name: str, extent: tuple, shape: tuple, centre: tuple) -> Case:
        return Case(name, tuple(torch.tensor(x, dtype=torch.float64) for x in (extent, shape, centre)))

    cases = [
        case("the standard grid", (192, 208, 192), (128, 144, 128), (0.5, -18, 9)),
        case("one voxel", (3, 4, 5), (1, 1, 1), (1, 2, 3)),
        case("plain voxels of 1 mm", (10, 20, 30), (10, 20, 30), (0, 0, 0)),
        case("flat voxels", (100, 100, 60), (50, 40, 10), (-7, 12, 3)),
    ]
    check_answer(function, lambda e, s, c: _affine(e / s, c - e / s * (s - 1) / 2), cases, mistakes, "grid_affine")


def _affine(sizes: Float[Tensor, " 3"], first: Float[Tensor, " 3"]) -> Float[Tensor, "4 4"]:
    affine = torch.diag(torch.cat([sizes, sizes.new_ones(1)]))
    affine[:3, 3] = first
    return affine


def pixel_share(function: object) -> None:
    """Check ``function(normal, offset)``: which part of the pixel [−½, ½]² satisfies ⟨normal, x⟩ ≤ offset."""
    mistakes = [
        Mistake(lambda n, d: float(d >= 0), "this tests the centre only; partial volume is the share of the *area*"),
        Mistake(lambda n, d: float(d > 0), "this tests the centre only; partial volume is the share of the *area*"),
        Mistake(
            lambda n, d: min(max(0.5 + d, 0.0), 1.0),
            "right only for a line parallel to a side of the pixel; for an oblique line the range is longer",
        ),
        Mistake(
            lambda n, d: min(max(0.5 + d / float(n.abs().sum()), 0.0), 1.0),
            "the ends are right and so is the middle, but where a corner is cut off the share grows like a square",
        ),
        Mistake(lambda n, d: 1 - _share(n, d), "this is the other side of the line: ⟨normal, x⟩ ≤ offset is asked for"),
    ]
    cases = []
    for degrees, offset in ((0, 0.0), (0, 0.3), (90, -0.2), (45, 0.0), (45, 0.5), (30, -0.4), (200, 0.1), (137, 0.55)):
        angle = math.radians(degrees)
        normal = torch.tensor([math.cos(angle), math.sin(angle)], dtype=torch.float64)
        normal = torch.where(normal.abs() < 1e-12, torch.zeros_like(normal), normal)
        cases.append(Case(f"a normal at {degrees} degrees, {offset} from the centre", (normal, offset)))
    cases.append(Case("a pixel that lies wholly inside", (cases[3].arguments[0], 2.0)))
    cases.append(Case("a pixel that lies wholly outside", (cases[5].arguments[0], -2.0)))
    check_answer(function, _share, cases, mistakes, "pixel_share")


def _share(normal: Float[Tensor, " 2"], offset: float) -> float:
    """A trapezoid: it grows like a square while a corner is cut, linearly in between."""
    short, long = sorted(float(x) for x in normal.abs())
    from_end = float(offset) + (short + long) / 2
    if short < 1e-12:
        return min(max(from_end / long, 0.0), 1.0)
    return float(
        sum(
            sign * max(from_end - start, 0.0) ** 2
            for sign, start in ((1, 0), (-1, short), (-1, long), (1, short + long))
        )
    ) / (2 * short * long)
