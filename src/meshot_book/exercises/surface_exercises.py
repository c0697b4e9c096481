"""Chapter 31: overlap of partial volumes, the Euler number of a mask, and distance below the voxel."""

import numpy as np
import torch

from meshot.types import Float, Tensor
from meshot_book.exercises.verdict import Case, Mistake, check_answer


def soft_overlap(function: object) -> None:
    """Check ``function(first, second)``: 2 Σ a b / (Σ a² + Σ b²) of two maps of any shape, 1 if both are empty."""
    mistakes = [
        Mistake(
            lambda a, b: 2 * (a * b).sum() / max(float((a + b).sum()), 1e-300) if (a + b).any() else 1.0,
            "for masks this is right, but a half-filled voxel predicted as half-filled must count as perfect: square "
            "below",
        ),
        Mistake(
            lambda a, b: _overlap((a > 0.5).double(), (b > 0.5).double()),
            "the maps are thresholded at ½ first; use the fractions themselves",
        ),
        Mistake(lambda a, b: _overlap(a, b) / 2, "the 2 is missing: equal maps must give 1"),
        Mistake(lambda a, b: 1 - _overlap(a, b), "this is one minus the overlap: equal maps must give 1"),
        Mistake(
            lambda a, b: (a * b).sum() / max(float((a**2 + b**2 - a * b).sum()), 1e-300) if (a + b).any() else 1.0,
            "this is the Jaccard index: the common part over the union; Dice divides by the mean of both sizes",
        ),
        Mistake(
            lambda a, b: _overlap(a, b) if (a + b).any() else 0.0, "two empty maps agree completely: return 1 for them"
        ),
    ]
    random = np.random.default_rng(0)
    masks = torch.from_numpy((random.random((2, 4, 5, 6)) > 0.6).astype(float))
    parts = torch.from_numpy(random.random((2, 40)))
    empty = torch.zeros(3, 3, dtype=torch.float64)
    cases = [
        Case("two masks", tuple(masks)),
        Case("two maps of fractions", tuple(parts)),
        Case("a map and itself", (parts[0], parts[0].clone())),
        Case("two maps that share nothing", (masks[0], 1 - masks[0])),
        Case("two empty maps", (empty, empty.clone())),
    ]
    check_answer(function, _overlap, cases, mistakes, "soft_overlap")


def _overlap(first: Tensor, second: Tensor) -> float:
    total = float((first**2 + second**2).sum())
    return 2 * float((first * second).sum()) / total if total else 1.0


def mask_euler(function: object) -> None:
    """Check ``function(mask)``: corners − edges + faces − cubes of a solid of voxels, each shared one counted once."""
    mistakes = [
        Mistake(
            lambda m: sum(sign * int(m.sum()) * n for sign, n in ((1, 8), (-1, 12), (1, 6), (-1, 1))),
            "every voxel counts its own corners; shared corners must be counted once",
        ),
        Mistake(
            lambda m: _euler(m) + int(m.sum()), "the cubes are missing: a solid is V − E + F − C, a surface V − E + F"
        ),
        Mistake(lambda m: 2 * _euler(m), "this is χ of the surface around it, twice as much as that of the solid"),
        Mistake(lambda m: -_euler(m), "the sign is wrong: a single voxel has 8 − 12 + 6 − 1 = 1"),
        Mistake(
            lambda m: _euler(np.pad(m, 1)[1:-1, 1:-1, 1:-1][:-1, :-1, :-1]),
            "voxels at the far border are left out: a grid of n voxels has n + 1 layers of corners",
        ),
    ]
    check_answer(function, _euler, [Case(name, (mask,)) for name, mask in _masks()], mistakes, "mask_euler")


def _masks() -> list[tuple[str, Tensor]]:
    one = torch.zeros(3, 3, 3, dtype=torch.bool)
    one[1, 1, 1] = True
    corner = torch.zeros(2, 2, 2, dtype=torch.bool)
    corner[1, 1, 1] = True
    ring, shell, pair = torch.ones(3, 3, 1, dtype=torch.bool), torch.ones(3, 3, 3, dtype=torch.bool), one.clone()
    ring[1, 1], shell[1, 1, 1], pair[2, 2, 2] = False, False, True
    noise = torch.from_numpy(np.random.default_rng(1).random((6, 5, 4)) > 0.5)
    return [
        ("one voxel", one),
        ("one voxel in the last corner", corner),
        ("a ring", ring),
        ("a hollow cube", shell),
        ("two voxels that touch in a corner", pair),
        ("a random mask", noise),
    ]


def _euler(mask: object) -> int:
    """By inclusion: an element is there if any voxel around it is."""
    data = np.pad(np.asarray(mask, dtype=bool), 1)
    total = 0
    for axes in np.ndindex(2, 2, 2):  # along which axes the element is thin
        present = data
        for axis, thin in enumerate(axes):
            n = present.shape[axis]
            low, high = np.take(present, range(n - 1), axis), np.take(present, range(1, n), axis)
            present = low | high if thin else high
        total += (-1) ** (3 - sum(axes)) * int(present.sum())
    return total


def row_distance(function: object) -> None:
    """Check ``function(fractions, size)``: signed distance in mm along one row of voxels, to where it crosses ½."""
    mistakes = [
        Mistake(lambda f, s: -_row(f, s), "the sign is wrong: negative inside, where the fraction is above ½"),
        Mistake(lambda f, s: _row(f, s).abs(), "distances inside must be negative"),
        Mistake(lambda f, s: _row(f, s) / s, "these are voxels; a distance is in mm"),
        Mistake(
            lambda f, s: _row((f > 0.5).double(), s),
            "right for a mask; fractions locate the border between two voxels: interpolate linearly",
        ),
        Mistake(
            _to_other_side,
            "this is the distance to the nearest voxel on the other side; the border lies between the two voxels",
        ),
    ]
    cases = [
        Case("one border", (torch.tensor([1.0, 1, 0.9, 0.3, 0, 0], dtype=torch.float64), 1.5)),
        Case("a band", (torch.tensor([0, 0.2, 0.8, 1, 1, 0.6, 0.1, 0, 0], dtype=torch.float64), 1.444)),
        Case("two bands", (torch.tensor([0.0, 0.7, 0.1, 0, 0, 0.55, 1, 0.2, 0], dtype=torch.float64), 2.0)),
        Case("a mask", (torch.tensor([0.0, 0, 1, 1, 1, 0], dtype=torch.float64), 1.0)),
    ]
    check_answer(function, _row, cases, mistakes, "row_distance")


def _row(fractions: Float[Tensor, " n"], size: float) -> Float[Tensor, " n"]:
    here, there = fractions[:-1], fractions[1:]
    crossing = ((here > 0.5) != (there > 0.5)).nonzero()[:, 0]
    places = crossing + (0.5 - here[crossing]) / (there[crossing] - here[crossing])
    centres = torch.arange(len(fractions), dtype=torch.float64)
    nearest = (centres[:, None] - places[None]).abs().min(dim=1).values * size
    return torch.where(fractions > 0.5, -nearest, nearest)


def _to_other_side(fractions: Float[Tensor, " n"], size: float) -> Float[Tensor, " n"]:
    inside = fractions > 0.5
    centres = torch.arange(len(fractions), dtype=torch.float64)
    gaps = (centres[:, None] - centres[None]).abs().masked_fill(inside[:, None] == inside[None], torch.inf)
    nearest = gaps.min(dim=1).values * size
    return torch.where(inside, -nearest, nearest)
