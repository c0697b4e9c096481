"""Exercises of chapters 16 to 24, from a scan to a surface: truths, cases, and the usual mistakes with their hints."""

import itertools
import math
from collections.abc import Callable, Sequence

import numpy as np
import scipy.ndimage
import torch

from meshot.mesh import icosphere
from meshot.types import Bool, Float, Int64, Tensor
from meshot_book.exercises.given import turned, waved
from meshot_book.exercises.verdict import Exercise, exercise

# Chapter 16: noise from air, the affine of a grid, and exact partial volume.


@exercise(stars=1)
def noise_from_air() -> Exercise:
    """Check ``function(values)``: σ of the noise in each channel, from magnitudes where there is no signal.

    By the second moment: the mean of the squared magnitude is 2 σ².
    """
    rng = np.random.default_rng(0)
    cases = {"magnitudes that are all 1": (torch.ones(5, dtype=torch.float64),)}
    for sigma, shape in ((3.0, (400,)), (0.5, (7, 8, 9)), (12.0, (50,))):
        real, imaginary = (torch.from_numpy(sigma * rng.standard_normal(shape)) for _ in range(2))
        cases[f"air of shape {shape} under noise of {sigma}"] = (torch.hypot(real, imaginary),)
    mistakes = {
        "the standard deviation of a magnitude is .66 σ, not the σ of a channel": (
            lambda v: v.std(correction=0),
            lambda v: v.std(),
        ),
        "right in the limit, but from the variance; use the mean of the squares, 2 σ²": (
            lambda v: v.std() / math.sqrt(2 - math.pi / 2),
            lambda v: v.std(correction=0) / math.sqrt(2 - math.pi / 2),
        ),
        "the squared magnitude is the sum of two channels: its mean is 2 σ²": lambda v: (v**2).mean().sqrt(),
        "this is σ²; σ has the unit of the signal": lambda v: (v**2).mean() / 2,
        "the mean of a magnitude is not σ, and here the second moment is asked for": lambda v: v.mean(),
        "right in the limit, but from the first moment; use the mean of the squares, 2 σ²": (
            lambda v: v.mean() / math.sqrt(math.pi / 2)
        ),
    }
    return Exercise(lambda v: ((v**2).mean() / 2).sqrt(), cases, mistakes)


@exercise(stars=2)
def grid_affine() -> Exercise:
    """Check ``function(extent_mm, shape, centre_mm)``: the affine of a grid whose box lies around a centre.

    The box is measured from the outer sides of its voxels; the axes of the grid are those of the world.
    """

    def affine_of(sizes: Float[Tensor, " 3"], first: Float[Tensor, " 3"]) -> Float[Tensor, "4 4"]:
        affine = torch.diag(torch.cat([sizes, sizes.new_ones(1)]))
        affine[:3, 3] = first
        return affine

    boxes = {
        "the standard grid": ((192, 208, 192), (128, 144, 128), (0.5, -18, 9)),
        "one voxel": ((3, 4, 5), (1, 1, 1), (1, 2, 3)),
        "plain voxels of 1 mm": ((10, 20, 30), (10, 20, 30), (0, 0, 0)),
        "flat voxels": ((100, 100, 60), (50, 40, 10), (-7, 12, 3)),
    }
    cases = {name: tuple(torch.tensor(box, dtype=torch.float64)) for name, box in boxes.items()}
    mistakes = {
        "index 0 is the *middle* of the first voxel; the box begins half a voxel before it": (
            lambda e, s, c: affine_of(e / s, c - e / 2)
        ),
        "n voxels are n sizes long from side to side, not n − 1; that would be from centre to centre": (
            lambda e, s, c: affine_of(e / (s - 1), c - e / 2)
        ),
        "the first voxel lies below the centre: subtract": lambda e, s, c: affine_of(e / s, c + e / s * (s - 1) / 2),
        "this puts the first voxel at the centre, not the middle of the box": lambda e, s, c: affine_of(e / s, c),
        "the voxels are not cubes; each axis has its own size": (
            lambda e, s, c: affine_of((e / s).mean().expand(3), c - (e / s).mean() * (s - 1) / 2)
        ),
        "the quotient is inverted: size is extent divided by count": (
            lambda e, s, c: affine_of(s / e, c - s / e * (s - 1) / 2)
        ),
    }
    return Exercise(lambda e, s, c: affine_of(e / s, c - e / s * (s - 1) / 2), cases, mistakes)


@exercise(stars=3)
def pixel_share() -> Exercise:
    """Check ``function(normal, offset)``: which part of the pixel [−½, ½]² satisfies ⟨normal, x⟩ ≤ offset."""

    def share(normal: Float[Tensor, " 2"], offset: float) -> float:
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

    cases, normals = {}, {}
    for degrees, offset in ((0, 0.0), (0, 0.3), (90, -0.2), (45, 0.0), (45, 0.5), (30, -0.4), (200, 0.1), (137, 0.55)):
        angle = math.radians(degrees)
        normal = torch.tensor([math.cos(angle), math.sin(angle)], dtype=torch.float64)
        normals[degrees] = torch.where(normal.abs() < 1e-12, torch.zeros_like(normal), normal)
        cases[f"a normal at {degrees} degrees, {offset} from the centre"] = (normals[degrees], offset)
    cases["a pixel that lies wholly inside"] = (normals[45], 2.0)
    cases["a pixel that lies wholly outside"] = (normals[30], -2.0)
    mistakes = {
        "this tests the centre only; partial volume is the share of the *area*": (
            lambda n, d: float(d >= 0),
            lambda n, d: float(d > 0),
        ),
        "right only for a line parallel to a side of the pixel; for an oblique line the range is longer": (
            lambda n, d: min(max(0.5 + d, 0.0), 1.0)
        ),
        "the ends are right and so is the middle, but where a corner is cut off the share grows like a square": (
            lambda n, d: min(max(0.5 + d / float(n.abs().sum()), 0.0), 1.0)
        ),
        "this is the other side of the line: ⟨normal, x⟩ ≤ offset is asked for": lambda n, d: 1 - share(n, d),
    }
    return Exercise(share, cases, mistakes)


# Chapter 17: overlap of partial volumes, the Euler number of a mask, and distance below the voxel.


@exercise(stars=1)
def soft_overlap() -> Exercise:
    """Check ``function(first, second)``: 2 Σ a b / (Σ a² + Σ b²) of two maps of any shape, 1 if both are empty."""

    def overlap(first: Tensor, second: Tensor) -> float:
        total = float((first**2 + second**2).sum())
        return 2 * float((first * second).sum()) / total if total else 1.0

    random = np.random.default_rng(0)
    masks = torch.from_numpy((random.random((2, 4, 5, 6)) > 0.6).astype(float))
    parts = torch.from_numpy(random.random((2, 40)))
    empty = torch.zeros(3, 3, dtype=torch.float64)
    cases = {
        "two masks": tuple(masks),
        "two maps of fractions": tuple(parts),
        "a map and itself": (parts[0], parts[0].clone()),
        "two maps that share nothing": (masks[0], 1 - masks[0]),
        "two empty maps": (empty, empty.clone()),
    }
    mistakes = {
        "for masks this is right, but a half-filled voxel predicted as half-filled must count as perfect: square "
        "below": (lambda a, b: 2 * (a * b).sum() / max(float((a + b).sum()), 1e-300) if (a + b).any() else 1.0),
        "the maps are thresholded at ½ first; use the fractions themselves": (
            lambda a, b: overlap((a > 0.5).double(), (b > 0.5).double())
        ),
        "the 2 is missing: equal maps must give 1": lambda a, b: overlap(a, b) / 2,
        "this is one minus the overlap: equal maps must give 1": lambda a, b: 1 - overlap(a, b),
        "this is the Jaccard index: the common part over the union; Dice divides by the mean of both sizes": (
            lambda a, b: (a * b).sum() / max(float((a**2 + b**2 - a * b).sum()), 1e-300) if (a + b).any() else 1.0
        ),
        "two empty maps agree completely: return 1 for them": lambda a, b: overlap(a, b) if (a + b).any() else 0.0,
    }
    return Exercise(overlap, cases, mistakes)


@exercise(stars=3)
def mask_euler() -> Exercise:
    """Check ``function(mask)``: corners − edges + faces − cubes of a solid of voxels, each shared one counted once."""

    def euler(mask: object) -> int:
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

    one, corner = torch.zeros(3, 3, 3, dtype=torch.bool), torch.zeros(2, 2, 2, dtype=torch.bool)
    one[1, 1, 1] = corner[1, 1, 1] = True
    ring, shell, pair = torch.ones(3, 3, 1, dtype=torch.bool), torch.ones(3, 3, 3, dtype=torch.bool), one.clone()
    ring[1, 1], shell[1, 1, 1], pair[2, 2, 2] = False, False, True
    cases = {
        "one voxel": (one,),
        "one voxel in the last corner": (corner,),
        "a ring": (ring,),
        "a hollow cube": (shell,),
        "two voxels that touch in a corner": (pair,),
        "a random mask": (torch.from_numpy(np.random.default_rng(1).random((6, 5, 4)) > 0.5),),
    }
    mistakes = {
        "every voxel counts its own corners; shared corners must be counted once": (
            lambda m: sum(sign * int(m.sum()) * n for sign, n in ((1, 8), (-1, 12), (1, 6), (-1, 1)))
        ),
        "the cubes are missing: a solid is V − E + F − C, a surface V − E + F": lambda m: euler(m) + int(m.sum()),
        "this is χ of the surface around it, twice as much as that of the solid": lambda m: 2 * euler(m),
        "the sign is wrong: a single voxel has 8 − 12 + 6 − 1 = 1": lambda m: -euler(m),
        "voxels at the far border are left out: a grid of n voxels has n + 1 layers of corners": (
            lambda m: euler(np.pad(m, 1)[1:-1, 1:-1, 1:-1][:-1, :-1, :-1])
        ),
    }
    return Exercise(euler, cases, mistakes)


@exercise(stars=2)
def row_distance() -> Exercise:
    """Check ``function(fractions, size)``: signed distance in mm along one row of voxels, to where it crosses ½."""

    def row(fractions: Float[Tensor, " n"], size: float) -> Float[Tensor, " n"]:
        here, there = fractions[:-1], fractions[1:]
        crossing = ((here > 0.5) != (there > 0.5)).nonzero()[:, 0]
        places = crossing + (0.5 - here[crossing]) / (there[crossing] - here[crossing])
        centres = torch.arange(len(fractions), dtype=torch.float64)
        nearest = (centres[:, None] - places[None]).abs().min(dim=1).values * size
        return torch.where(fractions > 0.5, -nearest, nearest)

    def to_other_side(fractions: Float[Tensor, " n"], size: float) -> Float[Tensor, " n"]:
        inside = fractions > 0.5
        centres = torch.arange(len(fractions), dtype=torch.float64)
        gaps = (centres[:, None] - centres[None]).abs().masked_fill(inside[:, None] == inside[None], torch.inf)
        nearest = gaps.min(dim=1).values * size
        return torch.where(inside, -nearest, nearest)

    cases = {
        "one border": (torch.tensor([1.0, 1, 0.9, 0.3, 0, 0], dtype=torch.float64), 1.5),
        "a band": (torch.tensor([0, 0.2, 0.8, 1, 1, 0.6, 0.1, 0, 0], dtype=torch.float64), 1.444),
        "two bands": (torch.tensor([0.0, 0.7, 0.1, 0, 0, 0.55, 1, 0.2, 0], dtype=torch.float64), 2.0),
        "a mask": (torch.tensor([0.0, 0, 1, 1, 1, 0], dtype=torch.float64), 1.0),
    }
    mistakes = {
        "the sign is wrong: negative inside, where the fraction is above ½": lambda f, s: -row(f, s),
        "distances inside must be negative": lambda f, s: row(f, s).abs(),
        "these are voxels; a distance is in mm": lambda f, s: row(f, s) / s,
        "right for a mask; fractions locate the border between two voxels: interpolate linearly": (
            lambda f, s: row((f > 0.5).double(), s)
        ),
        "this is the distance to the nearest voxel on the other side; the border lies between the two voxels": (
            to_other_side
        ),
    }
    return Exercise(row, cases, mistakes)


# Chapters 18 and 19: the network counted, cubes cut out or convolved once, displacements where area is missing.


@exercise(stars=1)
def count_weights() -> Exercise:
    """Check ``function(width, hidden, n_scales, size)``: how many numbers the deformation network learns."""

    def counted(
        width: int, hidden: Sequence[int], n_scales: int, size: int, biases: bool = True, entering: int | None = None
    ) -> int:
        sizes = [2 * width if entering is None else entering, *hidden, 3]
        layers = [(3, width), (n_scales * size**3, width), (width, width), *itertools.pairwise(sizes)]
        return sum((n_in + biases) * n_out for n_in, n_out in layers)

    cases = {
        "a network with one hidden layer": (8, (16,), 2, 3),
        "one scale": (4, (5, 6), 1, 3),
        "the small network": (32, (128, 64), 3, 5),
        "the paper's width": (128, (512, 256), 3, 5),
    }
    mistakes = {
        "the biases are missing: every layer, the convolution too, adds one number for each of its outputs": (
            lambda w, h, s, k: counted(w, h, s, k, biases=False)
        ),
        "features of position and image are concatenated: the input of the perceptron has twice the width": (
            lambda w, h, s, k: counted(w, h, s, k, entering=w)
        ),
        "every scale has a kernel of its own; the number of scales multiplies the weights of the convolution": (
            lambda w, h, s, k: counted(w, h, 1, k)
        ),
        "the scales are added up before the one bias: the convolution has one for each feature, not for each scale": (
            lambda w, h, s, k: counted(w, h, s, k) + (s - 1) * w
        ),
        "a cube has three sides: size³ voxels": lambda w, h, s, k: counted(w, h, s, k) - s * w * (k**3 - k**2),
        "the last layer is missing: from the last hidden neurons to the three numbers of a velocity": (
            lambda w, h, s, k: counted(w, h, s, k) - 3 * h[-1] - 3
        ),
        "the linear layer behind the convolution is missing: from width to width": (
            lambda w, h, s, k: counted(w, h, s, k) - w * w - w
        ),
    }
    return Exercise(counted, cases, mistakes)


@exercise(stars=2)
def feature_at() -> Exercise:
    """Check ``function(row, kernel, place)``: a feature between voxels, from a convolution done once.

    What it must equal is cut out word for word: Σ_o kernel[o] · row(place + o), where o runs over −h … h and the row is
    linear between voxels and zero beyond, towards which it falls over one voxel.
    """

    def row_at(row: Float[Tensor, " n"], places: np.ndarray, beyond: str) -> np.ndarray:
        outer = {"edge": (float(row[0]), float(row[-1])), "zero": (0.0, 0.0)}[beyond]
        values = np.concatenate([outer[:1], row.numpy(), outer[1:]])
        return np.interp(places, np.arange(-1, len(row) + 1), values)

    def cut(row: Float[Tensor, " n"], kernel: Float[Tensor, " k"], place: float, beyond: str = "zero") -> float:
        steps = np.arange(len(kernel)) - len(kernel) // 2
        return float(kernel.numpy() @ row_at(row, place + steps, beyond))

    def kept_inside(row: Float[Tensor, " n"], kernel: Float[Tensor, " k"], place: float) -> float:
        features = [cut(row, kernel, float(i)) for i in range(len(row))]
        return float(row_at(torch.tensor(features, dtype=torch.float64), np.array([place]), "zero")[0])

    random = np.random.default_rng(0)
    row, three, five = (torch.from_numpy(random.normal(size=n)) for n in (7, 3, 5))
    cases = {
        "a voxel": (row, three, 3.0),
        "a place between two voxels": (row, three, 2.3),
        "another place": (row, five, 3.75),
        "a place near the beginning": (row, five, 0.6),
        "a place beyond the end": (row, five, 7.4),
        "a place whose kernel does not reach the row": (row, three, 20.5),
    }
    mistakes = {
        "the kernel is reversed; here entry o stands for the voxel at +o (what networks call a convolution)": (
            lambda r, k, p: cut(r, k.flip(0), p)
        ),
        "this takes the nearest voxel; interpolate linearly between the two voxels around the position": (
            lambda r, k, p: cut(r, k, float(np.floor(p + 0.5)))
        ),
        "this takes the voxel below; interpolate linearly between the two voxels around the position": (
            lambda r, k, p: cut(r, k, float(np.floor(p)))
        ),
        "beyond the row there are zeros, not copies of its end": lambda r, k, p: cut(r, k, p, beyond="edge"),
        "a kernel centred beyond the row can still overlap it: convolve beyond its ends, by half a kernel or "
        "more": kept_inside,
        "the kernel is centred: its middle entry belongs to the voxel itself": (
            lambda r, k, p: cut(r, k, p + len(k) // 2)
        ),
    }
    return Exercise(cut, cases, mistakes)


@exercise(stars=1)
def alignment() -> Exercise:
    """Check ``function(descents, needed, masses)``: the cosine of two fields of arrows, weighted by mass."""

    def cosines(first: Float[Tensor, "n 3"], second: Float[Tensor, "n 3"]) -> Float[Tensor, " n"]:
        return torch.cosine_similarity(first, second, dim=1)

    def aligned(descents: Float[Tensor, "n 3"], needed: Float[Tensor, "n 3"], masses: Float[Tensor, " n"]) -> float:
        def inner(first: Tensor, second: Tensor) -> Tensor:
            return (masses * (first * second).sum(dim=1)).sum()

        return float(inner(descents, needed) / (inner(descents, descents) * inner(needed, needed)).sqrt())

    random = np.random.default_rng(1)
    descents, needed = (torch.from_numpy(random.normal(size=(6, 3))) for _ in range(2))
    masses = torch.from_numpy(random.uniform(0.1, 2.0, 6))
    cases = {
        "random arrows": (descents, needed, masses / masses.sum()),
        "arrows that point away": (-needed + 0.1 * descents, needed, masses / masses.sum()),
        "masses that do not sum to one": (descents[:4], needed[:4], masses[:4]),
        "equal masses": (descents[:3], needed[:3], torch.full((3,), 1 / 3, dtype=torch.float64)),
    }
    mistakes = {
        "every vertex has the same weight; use its mass, in the numerator and in the denominator": (
            lambda p, n, m: aligned(p, n, torch.ones_like(m))
        ),
        "this is the mean of the cosines; one cosine of all vectors is needed: add up first, then divide once": (
            lambda p, n, m: float((m * cosines(p, n)).sum() / m.sum())
        ),
        "the masses are in the numerator only; the two norms in the denominator need them too": (
            lambda p, n, m: float((m * (p * n).sum(dim=1)).sum() / (p.norm() * n.norm()))
        ),
        "the cosine is −1 for movement away from the target: keep the sign": lambda p, n, m: abs(aligned(p, n, m)),
        "the mass enters twice: multiply each product by the mass once": lambda p, n, m: aligned(m[:, None] * p, n, m),
    }
    return Exercise(aligned, cases, mistakes)


@exercise(stars=3)
def mean_displacements() -> Exercise:
    """Check ``function(places, source_areas, target_areas)``: the mean displacement of each region's mass.

    Regions lie at rising places; both surfaces have area in each. Masses are shares of area, and go along the line in
    order (the monotone plan).
    """

    def regional(
        places: Float[Tensor, " r"], source_areas: Float[Tensor, " r"], target_areas: Float[Tensor, " r"]
    ) -> Float[Tensor, " r"]:
        return carried(places, source_areas / source_areas.sum(), target_areas / target_areas.sum())

    def carried(
        places: Float[Tensor, " r"], source: Float[Tensor, " r"], target: Float[Tensor, " r"]
    ) -> Float[Tensor, " r"]:
        first, second = (torch.cat([part.new_zeros(1), part.cumsum(dim=0)]) for part in (source, target))
        shared_end = torch.minimum(first[1:, None], second[None, 1:])
        plan = (shared_end - torch.maximum(first[:-1, None], second[None, :-1])).clamp(min=0)
        return (plan * (places[None] - places[:, None])).sum(dim=1) / source

    places = torch.tensor([0.0, 40.0, 60.0, 100.0], dtype=torch.float64)
    full = torch.tensor([30.0, 20.0, 30.0, 20.0], dtype=torch.float64)
    lack = torch.tensor([30.0, 20.0, 30.0, 16.0], dtype=torch.float64)
    cases = {
        "surfaces with equal shares": (places, full, 2 * full),
        "two regions, one of which lacks area": (places[:2], lack[2:], full[2:]),
        "four regions, the last of which lacks area": (places, lack, full),
        "area lacking at the beginning": (places[:3], lack[1:], full[:3]),
        "mass that crosses a whole region": (places[:3], torch.ones(3).double(), full[[1, 1, 0]] ** 3),
    }
    mistakes = {
        "each surface is normalised by its own area, so that both have mass one": (
            lambda x, a, b: carried(x, a / a.sum(), b / a.sum())
        ),
        "this is mass times distance; the mean over the region's own mass is asked for, in mm": (
            lambda x, a, b: regional(x, a, b) * a / a.sum()
        ),
        "divided by the target's share; divide by the share of the source, whose mass moves": (
            lambda x, a, b: regional(x, a, b) * a / a.sum() / (b / b.sum())
        ),
        "the sign is reversed: movement towards larger coordinates is positive": lambda x, a, b: -regional(x, a, b),
        "source and target are exchanged": lambda x, a, b: -regional(x, b, a),
    }
    return Exercise(regional, cases, mistakes)


# Chapter 20: taking a floor out of a number, two sides of a distance, shares as counts, a table against itself.


@exercise(stars=1)
def without_floor() -> Exercise:
    """Check ``function(value, floor)``: what is left of a sampled W₂ when its floor is taken out."""
    cases = {
        "3, 4, 5": (5.0, 4.0),
        "a value far above its floor": (7.3, 0.2),
        "a value barely above its floor": (1.21, 1.2),
        "a value at its floor": (2.5, 2.5),
        "a value below its floor": (1.1, 1.3),
    }
    mistakes = {
        "do not subtract the lengths: their squares add up": (lambda v, f: v - f, lambda v, f: max(v - f, 0.0)),
        "this is a squared length, in mm², and negative below the floor: return the root, and 0 below the floor": (
            lambda v, f: v**2 - f**2
        ),
        "this is a squared length, in mm²: take the root": lambda v, f: max(v**2 - f**2, 0.0),
        "a ratio says how far above the floor, not how many millimetres": lambda v, f: v / f,
        "a value below the floor is due to chance: return 0 there": lambda v, f: math.sqrt(abs(v**2 - f**2)),
        "the sign is wrong: this adds the floor instead of removing it": lambda v, f: math.sqrt(v**2 + f**2),
    }
    return Exercise(lambda v, f: math.sqrt(max(v**2 - f**2, 0.0)), cases, mistakes)


@exercise(stars=2)
def two_sided() -> Exercise:
    """Check ``function(there, back)``: ASSD and the Hausdorff distance at 90 %, from the distances of both sides."""

    def mean(a: Float[Tensor, " n"], b: Float[Tensor, " m"]) -> Tensor:
        return (a.mean() + b.mean()) / 2

    def quantile(a: Float[Tensor, " n"], b: Float[Tensor, " m"]) -> Tensor:
        return max(a.quantile(0.9), b.quantile(0.9))

    def pair(first: object, second: object) -> Float[Tensor, " 2"]:
        return torch.stack([torch.as_tensor(first), torch.as_tensor(second)])

    both = torch.cat
    draw = np.random.default_rng(0).exponential(size=500)
    numbers = torch.from_numpy(draw)
    cases = {
        "equal sides": (numbers[:40], numbers[:40].flip(0)),
        "sides of other sizes": (numbers[:300], 3 * numbers[300:350]),
        "an error that one side sees": (torch.cat([numbers[:80], numbers[:20] + 50]) / 10, numbers[:100] / 10),
        "a perfect side": (torch.zeros(7, dtype=torch.float64), numbers[:9]),
    }
    mistakes = {
        "the side with more points counts more here: average each side first": (
            lambda a, b: pair(both([a, b]).mean(), quantile(a, b))
        ),
        "the two sides are averaged, not added": lambda a, b: pair(a.mean() + b.mean(), quantile(a, b)),
        "ASSD averages the sides; only HD takes the larger": (
            lambda a, b: pair(max(a.mean(), b.mean()), quantile(a, b))
        ),
        "this is the quantile of all distances together: take the quantile of each side, then the larger one": (
            lambda a, b: pair(mean(a, b), both([a, b]).quantile(0.9))
        ),
        "the points of both sides are pooled: treat each side by itself, then average the means and take the larger "
        "quantile": lambda a, b: pair(both([a, b]).mean(), both([a, b]).quantile(0.9)),
        "HD takes the larger of the two quantiles, not their mean": (
            lambda a, b: pair(mean(a, b), (a.quantile(0.9) + b.quantile(0.9)) / 2)
        ),
        "the larger one, not the smaller": lambda a, b: pair(mean(a, b), min(a.quantile(0.9), b.quantile(0.9))),
        "this is the Hausdorff distance at 100 %": lambda a, b: pair(mean(a, b), max(a.max(), b.max())),
        "only one side is used: a missing part appears only in the distances from the other side": (
            lambda a, b: pair(a.mean(), a.quantile(0.9))
        ),
    }
    return Exercise(lambda a, b: pair(mean(a, b), quantile(a, b)), cases, mistakes)


@exercise(stars=1)
def pairs_left() -> Exercise:
    """Check ``function(percent, n_faces, n_scans)``: how many crossing pairs a mean share below a bound can hide."""
    cases = {
        "the paper's bound, one surface of 260 000 faces": (1e-4, 260_000, 1),
        "the same as a mean over 80 scans": (1e-4, 260_000, 80),
        "a coarse mesh": (0.01, 20_480, 3),
        "less than one pair": (1e-4, 20_480, 80),
        "a generous bound": (1.03, 335_872, 7),
    }
    mistakes = {
        "the share is in per cent: divide by 100": lambda p, f, n: int(p * f * n / 2),
        "this counts faces; an intersecting pair has two faces": lambda p, f, n: int(p / 100 * f * n),
        "the mean is over all scans: one of them may have all the crossings": lambda p, f, n: int(p / 100 * f / 2),
        "the number of pairs must be whole": lambda p, f, n: p / 100 * f * n / 2,
        "rounded up, the share exceeds the bound: round down": (
            lambda p, f, n: math.ceil(p / 100 * f * n / 2),
            lambda p, f, n: round(p / 100 * f * n / 2),
        ),
        "more scans allow more pairs, not fewer": lambda p, f, n: int(p / 100 * f / 2 / n),
    }
    return Exercise(lambda p, f, n: int(p / 100 * f * n / 2), cases, mistakes)


@exercise(stars=3)
def breaks_bound() -> Exercise:
    """Check ``function(emd, swd, written)``: which rows of a table break SW₂ ≤ W₂/√3, as the columns are written.

    ``written`` is "roots" (W₂ and SW₂), "squares" (W₂² and SW₂²) or "half" (½ W₂² and SW₂²).
    """

    def breaks(emd: Float[Tensor, " n"], swd: Float[Tensor, " n"], written: str) -> Bool[Tensor, " n"]:
        return swd > emd * {"roots": 1 / math.sqrt(3), "squares": 1 / 3, "half": 2 / 3}[written]

    emd = torch.tensor([1.368, 1.051, 0.912, 0.803, 0.728, 0.425, 1.0, 0.6], dtype=torch.float64)
    swd = torch.tensor([1.357, 0.823, 0.525, 0.250, 0.420, 0.785, 0.5, 0.15], dtype=torch.float64)
    cases = {f"columns written as {word}": (emd, swd, word) for word in ("roots", "squares", "half")}
    mistakes = {
        "the factor 1/3 of the bound is missing: SW₂² ≤ W₂²/3": lambda e, s, w: s > e,
        "squares and halves have other bounds; look at `written`": lambda e, s, w: s > e / math.sqrt(3),
        "roots have another bound: √(1/3)": lambda e, s, w: s > e / 3,
        "the answer is negated: true where the row violates the bound": lambda e, s, w: ~breaks(e, s, w),
        "half of W₂² is given: W₂² is twice the number, so the bound is wider, not narrower": (
            lambda e, s, w: s > e * {"roots": 3**-0.5, "squares": 1 / 3, "half": 1 / 6}[w]
        ),
        "half of W₂² is given: W₂² is twice the number": (
            lambda e, s, w: s > e * {"roots": 3**-0.5, "squares": 1 / 3, "half": 1 / 3}[w]
        ),
        "the two columns are exchanged": lambda e, s, w: s * {"roots": 3**-0.5, "squares": 1 / 3, "half": 2 / 3}[w] > e,
    }
    return Exercise(breaks, cases, mistakes)


# Chapter 21: thin gyri between grid points, a Chamfer distance weighted by curvature, and chains of flows.


_Field = Callable[[Tensor], Tensor]


@exercise(stars=1)
def chance_missed() -> Exercise:
    """Check ``function(thickness, spacing)``: how often no layer of a grid falls into a slab parallel to it."""
    cases = {
        "a slab half as thick as the spacing": (0.5, 1.0),
        "a slab of 1.2 mm and voxels of 1.5 mm": (1.2, 1.5),
        "a slab as thick as the spacing": (1.0, 1.0),
        "a thick slab": (3.0, 1.0),
        "a slab without thickness": (1e-9, 2.0),
    }
    mistakes = {
        "this is the chance that a layer falls into the slab; the other is asked": lambda t, h: min(1.0, t / h),
        "below zero this is no chance; how often is a slab missed that is thick?": lambda t, h: 1 - t / h,
        "a slab thinner than the spacing is met by some positions of the grid": lambda t, h: float(t < h),
        "the slab has its thickness once, not on both sides": lambda t, h: max(0.0, 1 - 2 * t / h),
        "the grid repeats after one spacing, not after two": lambda t, h: max(0.0, 1 - t / (2 * h)),
        "thickness and spacing are exchanged": lambda t, h: max(0.0, 1 - h / t),
        "the slab is parallel to the layers: only one axis matters": lambda t, h: max(0.0, 1 - t / h) ** 3,
    }
    return Exercise(lambda t, h: max(0.0, 1 - t / h), cases, mistakes)


@exercise(stars=2)
def curved_chamfer() -> Exercise:
    """Check ``function(points, truths, curvatures, most)``: the Chamfer distance weighted by the target's curvature."""

    def curved(points, truths, curvatures, most, one=1.0, power=2, there=True, back=True, plain=False, mean=True):
        weights = (one + curvatures).clamp(max=most)
        gaps = torch.cdist(points, truths)
        nearest = gaps.min(dim=1)
        first = (1.0 if plain else weights[nearest.indices]) * nearest.values**power
        second = weights * gaps.min(dim=0).values ** power
        reduce = torch.mean if mean else torch.sum
        return there * reduce(first) + back * reduce(second)

    random = np.random.default_rng(0)
    found, truths = (torch.from_numpy(random.normal(size=(n, 3))) for n in (12, 9))
    curvatures = torch.from_numpy(random.uniform(0.2, 8.0, 9))
    cases = {
        "twelve points and nine": (found, truths, curvatures, 5.0),
        "weights that are all small": (found, truths, curvatures / 4, 5.0),
        "one pair": (found[:1], truths[:1], curvatures[:1], 2.0),
    }
    mistakes = {
        "the curvature changes nothing in your sum": lambda *a: curved(*a[:2], 0 * a[2], a[3]),
        "a weight may not exceed `most`": lambda *a: curved(*a[:3], torch.inf),
        "the weight of a flat place is one, not zero": lambda x, y, k, most: curved(x, y, k, most, one=0.0),
        "the distances are squared": lambda *a: curved(*a, power=1),
        "the nearest neighbours of the found points are missing": lambda *a: curved(*a, there=False),
        "the nearest neighbours of the true points are missing": lambda *a: curved(*a, back=False),
        "pairs of the first direction have a weight too: the curvature at the true point of the pair": (
            lambda *a: curved(*a, plain=True)
        ),
        "each direction is a mean over its points, not a sum": lambda *a: curved(*a, mean=False),
    }
    return Exercise(curved, cases, mistakes)


@exercise(stars=3)
def through_chain() -> Exercise:
    """Check ``function(fields, points, n_steps)``: points after the flows of several fields, by RK4, one by one."""

    def rk4(field: _Field, x: Tensor, h: float) -> Tensor:
        first = field(x)
        second = field(x + h / 2 * first)
        third = field(x + h / 2 * second)
        return x + h / 6 * (first + 2 * second + 2 * third + field(x + h * third))

    def midpoint(field: _Field, x: Tensor, h: float) -> Tensor:
        return x + h * field(x + h / 2 * field(x))

    def euler(field: _Field, x: Tensor, h: float) -> Tensor:
        return x + h * field(x)

    def chain(
        fields: Sequence[_Field], points: Float[Tensor, "n 3"], n_steps: int, step: Callable = rk4, length: float = 1.0
    ) -> Float[Tensor, "n 3"]:
        for field in fields:
            for _ in range(n_steps):
                points = step(field, points, length / n_steps)
        return points

    points = torch.from_numpy(np.random.default_rng(1).normal(size=(5, 3)))
    cases = {
        "a rotation and a wave": ([turned, waved], points, 4),
        "three fields": ([waved, turned, waved], points[:2], 3),
        "a wave and a rotation, two steps": ([waved, turned], points, 2),
    }
    mistakes = {
        "this is the flow of the sum of the fields; each flow begins where the one before it ended": (
            lambda fields, x, n: chain([lambda p: sum(f(p) for f in fields)], x, n)
        ),
        "the flows are in the reverse order": lambda fields, x, n: chain(fields[::-1], x, n),
        "this is Euler's method; RK4 takes four slopes a step": lambda fields, x, n: chain(fields, x, n, euler),
        "this is the midpoint rule; RK4 takes four slopes": lambda fields, x, n: chain(fields, x, n, midpoint),
        "every field acts for one unit of time, not for a share of it": (
            lambda fields, x, n: chain(fields, x, n, length=1 / len(fields))
        ),
        "the steps of a field have length 1 / n_steps": lambda fields, x, n: chain(fields, x, n, length=n),
        "only one step for every field; n_steps are needed": lambda fields, x, n: chain(fields, x, 1),
        "only the first field acts": lambda fields, x, n: chain(fields[:1], x, n),
    }
    return Exercise(chain, cases, mistakes)


# Chapter 22: paired differences, which check of a training is kept, and the order of a solver.


@exercise(stars=2)
def paired_gap() -> Exercise:
    """Check ``function(first, second)``: the mean difference over the same subjects, and its standard error."""

    def paired(differences: Tensor, first: Tensor, second: Tensor) -> Tensor:
        return differences.std(correction=1) / len(differences) ** 0.5

    def unpaired(differences: Tensor, first: Tensor, second: Tensor) -> Tensor:
        return ((first.var(correction=1) + second.var(correction=1)) / len(first)).sqrt()

    def gap(first: Float[Tensor, " n"], second: Float[Tensor, " n"], error: object = paired) -> Float[Tensor, " 2"]:
        differences = first - second
        return torch.stack([differences.mean(), error(differences, first, second)])

    random = np.random.default_rng(2)
    base, change = torch.from_numpy(random.normal(size=8)), torch.from_numpy(random.normal(0.1, 0.05, 8))
    cases = {
        "eight subjects that differ much, changed alike": (base + change, base),
        "two subjects": (base[:2], base[:2] + change[:2]),
        "a constant difference": (base + 0.25, base),
    }
    mistakes = {
        "this is the standard error of two independent groups; the same subjects are in both: take the standard "
        "deviation of the differences": (lambda x, y: gap(x, y, unpaired)),
        "this is the standard deviation of the differences; that of their mean is smaller by √n": (
            lambda x, y: gap(x, y, lambda d, *_: d.std(correction=1))
        ),
        "the standard deviation is that of a sample: divide by n − 1, not by n": (
            lambda x, y: gap(x, y, lambda d, *_: d.std(correction=0) / len(d) ** 0.5)
        ),
        "divided by n; the standard error is the standard deviation over √n": (
            lambda x, y: gap(x, y, lambda d, *_: d.std(correction=1) / len(d))
        ),
        "the sign is reversed: it is first minus second": lambda x, y: gap(y, x),
    }
    return Exercise(gap, cases, mistakes)


@exercise(stars=1)
def kept_check() -> Exercise:
    """Check ``function(initial, checks)``: the number of the check that is kept, or −1 for the initial surface."""

    def kept(initial: float, checks: list[float]) -> int:
        return int(np.argmin(checks)) if min(checks) < initial else -1

    cases = {
        "a training that improves to its end": (0.31, [0.30, 0.27, 0.24, 0.23]),
        "a training that improves and turns back": (0.31, [0.30, 0.26, 0.28, 0.33]),
        "a training that only gets worse": (0.31, [0.38, 0.40, 0.42]),
        "two equal checks": (0.31, [0.25, 0.22, 0.22, 0.29]),
        "a check as far as the initial surface": (0.31, [0.31, 0.35]),
    }
    mistakes = {
        "the initial surface is a candidate too: return −1 where no check is below it": lambda a, c: int(np.argmin(c)),
        "this keeps the last check; an earlier one may be nearer to the truth": (
            lambda a, c: -1 if c[-1] >= a else len(c) - 1
        ),
        "this keeps the first check below the initial distance; a later one may be smaller": (
            lambda a, c: next((i for i, value in enumerate(c) if value < a), -1)
        ),
        "distances: the smallest is the best, not the largest": lambda a, c: int(np.argmax(c)) if max(c) > a else -1,
        "of equal checks the first is kept, because it needs fewer steps": (
            lambda a, c: len(c) - 1 - int(np.argmin(c[::-1])) if min(c) < a else -1
        ),
    }
    return Exercise(kept, cases, mistakes)


@exercise(stars=3)
def observed_order() -> Exercise:
    """Check ``function(n_steps, errors)``: the order q for which errors fall as steps^(−q), by least squares."""

    def order(n_steps: Float[Tensor, " r"], errors: Float[Tensor, " r"]) -> float:
        return -float(np.polyfit(n_steps.log().numpy(), errors.log().numpy(), 1)[0])

    steps = torch.tensor([1.0, 5.0, 10.0, 50.0], dtype=torch.float64)
    noisy = 0.4 / steps * torch.tensor([1.2, 0.9, 1.1, 0.95], dtype=torch.float64)
    cases = {
        "Euler's method": (steps, 0.4 / steps),
        "a method of order four": (steps[1:], 3.0 / steps[1:] ** 4),
        "errors that scatter": (steps, noisy),
        "two runs": (steps[:2], torch.tensor([0.3, 0.05], dtype=torch.float64)),
    }
    mistakes = {
        "the sign is reversed: errors that decrease have a positive order": lambda n, e: -order(n, e),
        "this uses the first and the last run only; fit a line through all of them by least squares": (
            lambda n, e: float(torch.log(e[0] / e[-1]) / torch.log(n[-1] / n[0]))
        ),
        "the steps need a logarithm too: a power law is a line where both axes are logarithmic": (
            lambda n, e: -float(np.polyfit(n.numpy(), e.log().numpy(), 1)[0])
        ),
        "the errors need a logarithm too: a power law is a line where both axes are logarithmic": (
            lambda n, e: -float(np.polyfit(n.log().numpy(), e.numpy(), 1)[0])
        ),
        "this line is forced through the origin; the power law has a constant in front": (
            lambda n, e: -float((n.log() * e.log()).sum() / (n.log() ** 2).sum())
        ),
    }
    return Exercise(order, cases, mistakes)


# Chapter 23: handles from faces, FreeSurfer's surface space, and simple points in the plane.


@exercise(stars=1)
def handles() -> Exercise:
    """Check ``function(faces)``: how many handles a closed, connected surface has, from its faces alone."""

    def sides(faces: Int64[Tensor, "F 3"]) -> Int64[Tensor, "S 2"]:
        return torch.cat([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])

    def edges(faces: Int64[Tensor, "F 3"]) -> Int64[Tensor, "E 2"]:
        return torch.unique(sides(faces).sort(dim=1).values, dim=0)

    def euler(faces: Int64[Tensor, "F 3"]) -> int:
        return len(faces.unique()) - len(edges(faces)) + len(faces)

    def torus(n: int, m: int) -> Int64[Tensor, "F 3"]:
        corner = torch.arange(n * m).reshape(n, m)
        right, up = corner.roll(-1, 0), corner.roll(-1, 1)
        both = right.roll(-1, 1)
        return torch.cat([torch.stack([corner, right, both], -1), torch.stack([corner, both, up], -1)]).reshape(-1, 3)

    def two_holes() -> Int64[Tensor, "F 3"]:
        """Two tori, a face cut out of each, sewn together along the three edges (reversed on one side)."""
        first = torus(4, 5)
        second = torus(5, 5) + 20
        (a, b, c), (x, y, z) = first[0].tolist(), second[0].tolist()
        sewn = second[1:].clone()
        for old, new in ((x, a), (y, c), (z, b)):
            sewn[second[1:] == old] = new
        return torch.cat([first[1:], sewn])

    sphere, ring = icosphere(1).faces, torus(5, 4)
    cases = {
        "a sphere": (sphere,),
        "a tetrahedron": (torch.tensor([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]),),
        "a torus": (ring,),
        "a torus of another size": (torus(3, 7),),
        "a torus whose vertices are numbered with gaps": (3 * ring + 10,),
        "a ring with two holes": (two_holes(),),
    }
    mistakes = {
        "this is the Euler number χ itself; each handle lowers it by two: χ = 2 − 2 g": euler,
        "this is 2 − χ; each handle accounts for two of it": lambda f: 2 - euler(f),
        "the sign is wrong: more handles give a smaller χ": lambda f: (euler(f) - 2) // 2,
        # On a surface whose faces turn the same way, both of these count every edge twice.
        "every edge is counted once for each of its two faces; (a, b) and (b, a) are the same edge: count each pair of "
        "vertices once": (
            lambda f: (2 - (len(f.unique()) - 3 * len(f) + len(f))) // 2,
            lambda f: (2 - (len(f.unique()) - len(torch.unique(sides(f), dim=0)) + len(f))) // 2,
        ),
        "the numbers may have gaps; count only the vertices that occur in faces": (
            lambda f: (2 - (int(f.max()) + 1 - len(edges(f)) + len(f))) // 2
        ),
    }
    return Exercise(lambda f: (2 - euler(f)) // 2, cases, mistakes)


@exercise(stars=2)
def surface_ras() -> Exercise:
    """Check ``function(points_mm, affine, shape)``: scanner RAS to the surface RAS of a conformed FreeSurfer volume.

    A conformed volume has cubic voxels, and its axes run to the left, downwards and to the front.
    """

    def half(shape: tuple[int, ...] | list[int]) -> Float[Tensor, " 3"]:
        return torch.tensor(shape, dtype=torch.float64) / 2

    def centre(affine: Float[Tensor, "4 4"], shape: tuple[int, ...] | list[int]) -> Float[Tensor, " 3"]:
        return affine[:3, :3] @ half(shape) + affine[:3, 3]

    points = torch.from_numpy(np.random.default_rng(0).normal(scale=30, size=(6, 3)))

    def conformed(size: float, *first: float) -> Float[Tensor, "4 4"]:
        rows = [[-size, 0, 0, first[0]], [0, 0, size, first[1]], [0, -size, 0, first[2]], [0, 0, 0, 1]]
        return torch.tensor(rows, dtype=torch.float64)

    cases = {
        "256³ voxels of 1 mm": (points, conformed(1, 125.8, -94.6, 133.3), (256, 256, 256)),
        "320³ voxels of 0.8 mm": (points, conformed(0.8, 140, -120, 90.5), (320, 320, 320)),
        "a volume that is centred at the origin but for 5 mm": (points, conformed(1, 128, -128, 133), (256, 256, 256)),
        "one point": (points[:1], conformed(1, 90, -80, 110), (256, 256, 256)),
    }
    mistakes = {
        "c_ras is added; that maps surface RAS to scanner RAS, the inverse": lambda p, a, s: p + centre(a, s),
        "FreeSurfer's centre is at half the *number* of voxels, not at half the last index": (
            lambda p, a, s: p - centre(a, [n - 1 for n in s])
        ),
        "the last column of the affine is missing; map the centre with the whole affine": (
            lambda p, a, s: p - a[:3, :3] @ half(s)
        ),
        "this moves the first voxel to the origin; the centre must move there": lambda p, a, s: p - a[:3, 3],
        "these are voxels counted from the centre; surface RAS stays in mm, along the scanner's axes": (
            lambda p, a, s: (p - a[:3, 3]) @ torch.linalg.inv(a[:3, :3]).T - half(s)
        ),
        "unchanged: right only for a scan that is centred at the origin": lambda p, a, s: p,
    }
    return Exercise(lambda p, a, s: p - centre(a, s), cases, mistakes)


@exercise(stars=3)
def is_simple() -> Exercise:
    """Check ``function(neighbourhood)``: may the middle of a 3 × 3 mask be added without changing the topology?

    Pixels of the object hang together by edges and corners (8), those of the background by edges (4).
    """

    def n_parts(mask: np.ndarray, neighbours: int, touching: bool = False) -> int:
        """How many parts hang together by so many neighbours; only those that share an edge with the middle."""
        labels, n = scipy.ndimage.label(mask, {4: None, 8: np.ones((3, 3))}[neighbours])
        return len({int(labels[p]) for p in ((0, 1), (1, 0), (1, 2), (2, 1))} - {0}) if touching else n

    def around(mask: Tensor) -> tuple[np.ndarray, np.ndarray]:
        """Object and background, both without the middle."""
        ring = np.ones((3, 3), dtype=bool)
        ring[1, 1] = False
        return mask.numpy() & ring, ~mask.numpy() & ring

    def simple(mask: Tensor) -> bool:
        inside, outside = around(mask)
        return n_parts(inside, 8) == 1 and n_parts(outside, 4, touching=True) == 1

    cases = {}
    for values in itertools.product((False, True), repeat=8):
        mask = torch.tensor([*values[:4], False, *values[4:]]).reshape(3, 3)
        drawn = " / ".join("".join(".#"[int(v)] for v in row) for row in mask)
        cases[f"the neighbourhood {drawn}"] = (mask,)
    mistakes = {
        "a pixel with some neighbours may still close a ring or join two parts": lambda m: 0 < int(m.sum()) < 8,
        "one part of the object around is not enough: a pixel in the middle of a ring fills a hole": (
            lambda m: n_parts(around(m)[0], 8) == 1
        ),
        "object pixels are also connected through corners: 8 neighbours, not 4": (
            lambda m: n_parts(around(m)[0], 4) == 1
        ),
        "the background is connected through edges only: 4 neighbours, not 8": (
            lambda m: n_parts(around(m)[1], 8, touching=True) == 1
        ),
        "a background pixel at a corner does not touch the middle; count only parts that share an edge with it": (
            lambda m: n_parts(around(m)[0], 8) == 1 and n_parts(around(m)[1], 4) == 1
        ),
    }
    return Exercise(simple, cases, mistakes)


# Chapter 24: a mean over a surface, and the thickness between two curves.


@exercise(stars=1)
def mean_by_area() -> Exercise:
    """Check ``function(values, vertices, faces)``: the mean of a number of vertices over a surface, by area."""

    def face_areas(v: Float[Tensor, "V 3"], f: Int64[Tensor, "F 3"]) -> Float[Tensor, " F"]:
        a, b, c = v[f].unbind(dim=1)
        return torch.linalg.cross(b - a, c - a).norm(dim=1) / 2

    def weights(v: Float[Tensor, "V 3"], f: Int64[Tensor, "F 3"], each: Float[Tensor, " F"]) -> Float[Tensor, " V"]:
        return torch.zeros(len(v), dtype=v.dtype).index_add(0, f.flatten(), each.repeat_interleave(3))

    def mean(t: Float[Tensor, " V"], v: Float[Tensor, "V 3"], f: Int64[Tensor, "F 3"]) -> float:
        return float((t[f].mean(dim=1) * face_areas(v, f)).sum() / face_areas(v, f).sum())

    def counted(t: Float[Tensor, " V"], v: Float[Tensor, "V 3"], f: Int64[Tensor, "F 3"]) -> float:
        around = weights(v, f, torch.ones(len(f), dtype=v.dtype))
        return float((t * around).sum() / around.sum())

    def whole(t: Float[Tensor, " V"], v: Float[Tensor, "V 3"], f: Int64[Tensor, "F 3"]) -> float:
        return float((t * weights(v, f, face_areas(v, f))).sum() / face_areas(v, f).sum())

    def of_squares(t: Float[Tensor, " V"], v: Float[Tensor, "V 3"], f: Int64[Tensor, "F 3"]) -> float:
        squares = face_areas(v, f) ** 2
        return float((t[f].mean(dim=1) * squares).sum() / squares.sum())

    ball = icosphere(2)
    random = torch.from_numpy(np.random.default_rng(0).uniform(1, 4, len(ball.vertices)))
    stretched = ball.vertices * torch.tensor([1.0, 1.0, 6.0]).double()
    flat = torch.tensor([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [9, 9, 0]]).double()
    cases = {
        "two triangles of unequal size": (
            torch.tensor([1.0, 2.0, 3.0, 5.0]).double(), flat, torch.tensor([[0, 1, 2], [1, 3, 2]]),
        ),
        "the same number everywhere": (torch.full((len(ball.vertices),), 2.5).double(), stretched, ball.faces),
        "a long ellipsoid": (random, stretched, ball.faces),
        "a sphere": (random, ball.vertices, ball.faces),
    }  # fmt: skip
    mistakes = {
        "this is the mean over vertices; small faces then count as much as large ones": lambda t, v, f: float(t.mean()),
        "every face counts alike here, whatever its area; weight each by its area": (
            counted,
            lambda t, v, f: float(t[f].mean()),
        ),
        "a vertex has a third of the area of each of its faces; with the whole area the sum is three times too large": (
            whole
        ),
        "this is the sum over the surface; divide by the area": (
            lambda t, v, f: float((t[f].mean(dim=1) * face_areas(v, f)).sum())
        ),
        "the area is squared; is the root of the cross product missing?": of_squares,
    }
    return Exercise(mean, cases, mistakes)


@exercise(stars=2)
def curve_thickness() -> Exercise:
    """Check ``function(white, pial, k)``: the thickness at vertex k between two curves whose vertices correspond.

    It is the mean of two distances: from ``white[k]`` to the nearest point of the pial curve, and from ``pial[k]`` to
    the nearest point of the white curve. A curve is a chain of segments.
    """

    def to_chain(point: Float[Tensor, " 2"], chain: Float[Tensor, "n 2"], clamped: bool = True) -> float:
        start, way = chain[:-1], chain[1:] - chain[:-1]
        part = ((point - start) * way).sum(dim=1) / (way**2).sum(dim=1)
        part = part.clamp(0, 1) if clamped else part
        return float((start + part[:, None] * way - point).norm(dim=1).min())

    def to_vertices(point: Float[Tensor, " 2"], chain: Float[Tensor, "n 2"]) -> float:
        return float((chain - point).norm(dim=1).min())

    def both(white: Float[Tensor, "n 2"], pial: Float[Tensor, "n 2"], k: int) -> tuple[float, float]:
        return to_chain(white[k], pial), to_chain(pial[k], white)

    x = torch.linspace(0, 6, 7).double()
    fold = torch.stack([x, 2 * torch.cos(2 * x)], dim=1)
    straight = torch.stack([x, torch.zeros_like(x)], dim=1)
    slid = straight + torch.tensor([0.4, 2.0]).double()
    cap = torch.stack([x, 1.5 * torch.cos(2 * x) + 2.5], dim=1) + torch.tensor([0.8, 0.0]).double()
    cases = {
        "two straight lines that are shifted": (straight, slid, 3),
        "their first vertex": (straight, slid, 0),
        "a fold": (fold, cap, 2),
        "another vertex of it": (fold, cap, 4),
        "the last vertex": (fold, cap, 6),
    }
    mistakes = {
        "this is the distance between the two vertices of a pair; take the nearest point of the other curve": (
            lambda w, p, k: float((w[k] - p[k]).norm())
        ),
        "this is the nearest vertex; the nearest point may lie between two vertices": (
            lambda w, p, k: (to_vertices(w[k], p) + to_vertices(p[k], w)) / 2
        ),
        "only the way from the white curve counts here; take the mean of both ways": lambda w, p, k: both(w, p, k)[0],
        "only the way from the pial curve counts here; take the mean of both ways": lambda w, p, k: both(w, p, k)[1],
        "this is the larger of the two distances; take their mean": lambda w, p, k: max(both(w, p, k)),
        "a segment ends at its vertices; keep the foot of the perpendicular between them": (
            lambda w, p, k: (to_chain(w[k], p, clamped=False) + to_chain(p[k], w, clamped=False)) / 2
        ),
    }
    return Exercise(lambda w, p, k: sum(both(w, p, k)) / 2, cases, mistakes)
