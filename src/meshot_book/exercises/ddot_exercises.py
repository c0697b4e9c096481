"""Chapter 32: the network counted, cubes cut out or convolved once, displacements where area is missing."""

import itertools
from collections.abc import Sequence

import numpy as np
import torch

from meshot.types import Float, Tensor
from meshot_book.exercises.verdict import Case, Mistake, check_answer


def count_weights(function: object) -> None:
    """Check ``function(width, hidden, n_scales, size)``: how many numbers the deformation network learns."""
    mistakes = [
        Mistake(
            lambda w, h, s, k: _counted(w, h, s, k, biases=False),
            "the biases are missing: every layer, the convolution too, adds one number for each of its outputs",
        ),
        Mistake(
            lambda w, h, s, k: _counted(w, h, s, k, entering=w),
            "features of position and image are concatenated: the input of the perceptron has twice the width",
        ),
        Mistake(
            lambda w, h, s, k: _counted(w, h, 1, k),
            "every scale has a kernel of its own; the number of scales multiplies the weights of the convolution",
        ),
        Mistake(
            lambda w, h, s, k: _counted(w, h, s, k) + (s - 1) * w,
            "the scales are added up before the one bias: the convolution has one for each feature, not for each scale",
        ),
        Mistake(
            lambda w, h, s, k: _counted(w, h, s, k) - s * w * (k**3 - k**2),
            "a cube has three sides: size³ voxels",
        ),
        Mistake(
            lambda w, h, s, k: _counted(w, h, s, k) - 3 * h[-1] - 3,
            "the last layer is missing: from the last hidden neurons to the three numbers of a velocity",
        ),
        Mistake(
            lambda w, h, s, k: _counted(w, h, s, k) - w * w - w,
            "the linear layer behind the convolution is missing: from width to width",
        ),
    ]
    cases = [
        Case("a network with one hidden layer", (8, (16,), 2, 3)),
        Case("one scale", (4, (5, 6), 1, 3)),
        Case("the small network", (32, (128, 64), 3, 5)),
        Case("the paper's width", (128, (512, 256), 3, 5)),
    ]
    check_answer(function, _counted, cases, mistakes, "count_weights")


def _counted(
    width: int, hidden: Sequence[int], n_scales: int, size: int, biases: bool = True, entering: int | None = None
) -> int:
    sizes = [2 * width if entering is None else entering, *hidden, 3]
    layers = [(3, width), (n_scales * size**3, width), (width, width), *itertools.pairwise(sizes)]
    return sum((n_in + biases) * n_out for n_in, n_out in layers)


def feature_at(function: object) -> None:
    """Check ``function(row, kernel, place)``: a feature between voxels, from a convolution done once.

    What it must equal is cut out word for word: Σ_o kernel[o] · row(place + o), where o runs over −h … h and the row is
    linear between voxels and zero beyond, towards which it falls over one voxel.
    """
    mistakes = [
        Mistake(
            lambda r, k, p: _cut(r, k.flip(0), p),
            "the kernel is reversed; here entry o stands for the voxel at +o (what networks call a convolution)",
        ),
        Mistake(
            lambda r, k, p: _cut(r, k, float(np.floor(p + 0.5))),
            "this takes the nearest voxel; interpolate linearly between the two voxels around the position",
        ),
        Mistake(
            lambda r, k, p: _cut(r, k, float(np.floor(p))),
            "this takes the voxel below; interpolate linearly between the two voxels around the position",
        ),
        Mistake(
            lambda r, k, p: _cut(r, k, p, beyond="edge"),
            "beyond the row there are zeros, not copies of its end",
        ),
        Mistake(
            _kept_inside,
            "a kernel centred beyond the row can still overlap it: convolve beyond its ends, by half a kernel or more",
        ),
        Mistake(
            lambda r, k, p: _cut(r, k, p + len(k) // 2),
            "the kernel is centred: its middle entry belongs to the voxel itself",
        ),
    ]
    random = np.random.default_rng(0)
    row, three, five = (torch.from_numpy(random.normal(size=n)) for n in (7, 3, 5))
    cases = [
        Case("a voxel", (row, three, 3.0)),
        Case("a place between two voxels", (row, three, 2.3)),
        Case("another place", (row, five, 3.75)),
        Case("a place near the beginning", (row, five, 0.6)),
        Case("a place beyond the end", (row, five, 7.4)),
        Case("a place whose kernel does not reach the row", (row, three, 20.5)),
    ]
    check_answer(function, _cut, cases, mistakes, "feature_at")


def _row_at(row: Float[Tensor, " n"], places: np.ndarray, beyond: str) -> np.ndarray:
    outer = {"edge": (float(row[0]), float(row[-1])), "zero": (0.0, 0.0)}[beyond]
    values = np.concatenate([outer[:1], row.numpy(), outer[1:]])
    return np.interp(places, np.arange(-1, len(row) + 1), values)


def _cut(row: Float[Tensor, " n"], kernel: Float[Tensor, " k"], place: float, beyond: str = "zero") -> float:
    steps = np.arange(len(kernel)) - len(kernel) // 2
    return float(kernel.numpy() @ _row_at(row, place + steps, beyond))


def _kept_inside(row: Float[Tensor, " n"], kernel: Float[Tensor, " k"], place: float) -> float:
    features = [_cut(row, kernel, float(i)) for i in range(len(row))]
    return float(_row_at(torch.tensor(features, dtype=torch.float64), np.array([place]), "zero")[0])


def alignment(function: object) -> None:
    """Check ``function(descents, needed, masses)``: the cosine of two fields of arrows, weighted by mass."""
    mistakes = [
        Mistake(
            lambda p, n, m: _aligned(p, n, torch.ones_like(m)),
            "every vertex has the same weight; use its mass, in the numerator and in the denominator",
        ),
        Mistake(
            lambda p, n, m: float((m * _cosines(p, n)).sum() / m.sum()),
            "this is the mean of the cosines; one cosine of all vectors is needed: add up first, then divide once",
        ),
        Mistake(
            lambda p, n, m: float((m * (p * n).sum(dim=1)).sum() / (p.norm() * n.norm())),
            "the masses are in the numerator only; the two norms in the denominator need them too",
        ),
        Mistake(
            lambda p, n, m: abs(_aligned(p, n, m)), "the cosine is −1 for movement away from the target: keep the sign"
        ),
        Mistake(
            lambda p, n, m: _aligned(m[:, None] * p, n, m),
            "the mass enters twice: multiply each product by the mass once",
        ),
    ]
    random = np.random.default_rng(1)
    descents, needed = (torch.from_numpy(random.normal(size=(6, 3))) for _ in range(2))
    masses = torch.from_numpy(random.uniform(0.1, 2.0, 6))
    cases = [
        Case("random arrows", (descents, needed, masses / masses.sum())),
        Case("arrows that point away", (-needed + 0.1 * descents, needed, masses / masses.sum())),
        Case("masses that do not sum to one", (descents[:4], needed[:4], masses[:4])),
        Case("equal masses", (descents[:3], needed[:3], torch.full((3,), 1 / 3, dtype=torch.float64))),
    ]
    check_answer(function, _aligned, cases, mistakes, "alignment")


def _cosines(first: Float[Tensor, "n 3"], second: Float[Tensor, "n 3"]) -> Float[Tensor, " n"]:
    return torch.cosine_similarity(first, second, dim=1)


def _aligned(descents: Float[Tensor, "n 3"], needed: Float[Tensor, "n 3"], masses: Float[Tensor, " n"]) -> float:
    def inner(first: Tensor, second: Tensor) -> Tensor:
        return (masses * (first * second).sum(dim=1)).sum()

    return float(inner(descents, needed) / (inner(descents, descents) * inner(needed, needed)).sqrt())


def mean_displacements(function: object) -> None:
    """Check ``function(places, source_areas, target_areas)``: the mean displacement of each region's mass.

    Regions lie at rising places; both surfaces have area in each. Masses are shares of area, and go along the line in
    order (the monotone plan).
    """
    mistakes = [
        Mistake(
            lambda x, a, b: _carried(x, a / a.sum(), b / a.sum()),
            "each surface is normalised by its own area, so that both have mass one",
        ),
        Mistake(
            lambda x, a, b: _regional(x, a, b) * a / a.sum(),
            "this is mass times distance; the mean over the region's own mass is asked for, in mm",
        ),
        Mistake(
            lambda x, a, b: _regional(x, a, b) * a / a.sum() / (b / b.sum()),
            "divided by the target's share; divide by the share of the source, whose mass moves",
        ),
        Mistake(
            lambda x, a, b: -_regional(x, a, b), "the sign is reversed: movement towards larger coordinates is positive"
        ),
        Mistake(
            lambda x, a, b: -_regional(x, b, a),
            "source and target are exchanged",
        ),
    ]
    places = torch.tensor([0.0, 40.0, 60.0, 100.0], dtype=torch.float64)
    full = torch.tensor([30.0, 20.0, 30.0, 20.0], dtype=torch.float64)
    lack = torch.tensor([30.0, 20.0, 30.0, 16.0], dtype=torch.float64)
    cases = [
        Case("surfaces with equal shares", (places, full, 2 * full)),
        Case("two regions, one of which lacks area", (places[:2], lack[2:], full[2:])),
        Case("four regions, the last of which lacks area", (places, lack, full)),
        Case("area lacking at the beginning", (places[:3], lack[1:], full[:3])),
        Case("mass that crosses a whole region", (places[:3], torch.ones(3).double(), full[[1, 1, 0]] ** 3)),
    ]
    check_answer(function, _regional, cases, mistakes, "mean_displacements")


def _regional(
    places: Float[Tensor, " r"], source_areas: Float[Tensor, " r"], target_areas: Float[Tensor, " r"]
) -> Float[Tensor, " r"]:
    return _carried(places, source_areas / source_areas.sum(), target_areas / target_areas.sum())


def _carried(
    places: Float[Tensor, " r"], source: Float[Tensor, " r"], target: Float[Tensor, " r"]
) -> Float[Tensor, " r"]:
    first, second = (torch.cat([part.new_zeros(1), part.cumsum(dim=0)]) for part in (source, target))
    shared_end = torch.minimum(first[1:, None], second[None, 1:])
    plan = (shared_end - torch.maximum(first[:-1, None], second[None, :-1])).clamp(min=0)
    return (plan * (places[None] - places[:, None])).sum(dim=1) / source
