"""Pairs of measures as Hypothesis draws them: ties, empty weights, tiny and huge scales, strided inputs, two dtypes."""

import dataclasses
import math
import os

import hypothesis.strategies as st
import numpy as np
import torch
from hypothesis import HealthCheck, given, settings

from meshot import DiscreteMeasure, SurfaceMeasure

#: So many problems for each loss and each measure; ``make fuzz`` asks for 20 000.
N_PROBLEMS = int(os.environ.get("MESHOT_DRAWN", "200"))
SEEDS = st.integers(0, 2**32 - 1)
DIMENSIONS = st.integers(1, 12)
EXPONENTS = st.sampled_from([1, 1.5, 2, 3])
#: Powers of ten; cubes of the largest and smallest are still numbers. The last of float64 is among the denormals.
SCALES = {torch.float64: (0, 0, -6, 6, -100, 100, -310), torch.float32: (0, 0, -3, 3, -12, 12)}


def drawn(*strategies, n_examples=N_PROBLEMS):
    """The test over so many draws, the same ones in every run."""
    chosen = settings(max_examples=n_examples, suppress_health_check=list(HealthCheck))
    return lambda test: chosen(given(*strategies)(test))


@dataclasses.dataclass(frozen=True, eq=False)
class Pair:
    """Two measures, the largest norm of their points, and the unit of rounding of their dtype."""

    source: DiscreteMeasure
    target: DiscreteMeasure

    @property
    def size(self) -> float:
        """The largest norm of a point."""
        return max(float(m.points.double().abs().max()) * math.sqrt(m.points.shape[1]) for m in self.both)

    @property
    def both(self) -> tuple[DiscreteMeasure, DiscreteMeasure]:
        """The two."""
        return self.source, self.target

    def rounding(self, p: float) -> float:
        """How far a transport cost may be off by rounding.

        A projection is a sum of d products: off by d·ε·R, R the size, so that a cost, at most (2R)^p, is off by
        p·2d·ε·(2R)^p/2. Cumulative masses are sums of n terms: off by n·ε, and what is assigned wrongly travels 2R at
        most. Twice all that, since the twin rounds as well; and some of the smallest numbers, where costs underflow.
        """
        n, d = sum(len(m.points) for m in self.both), self.source.points.shape[1]
        epsilon = torch.finfo(self.source.points.dtype).eps
        least = torch.finfo(self.source.points.dtype).smallest_normal
        return 2 * (p * d + n + 4) * epsilon * (2 * self.size) ** p + 4 * n * least


def strided(array: np.ndarray, kind: str) -> torch.Tensor:
    """The same numbers in another layout of memory."""
    tensor = torch.from_numpy(array)
    if kind == "strided":
        return torch.stack([tensor, tensor + 1], dim=-1)[..., 0]
    return tensor.T.contiguous().T if kind == "transposed" and tensor.ndim == 2 else tensor


@st.composite
def pairs(draw, equal: bool = False, dimensions=DIMENSIONS) -> Pair:
    """Two measures in one space, of 1 to 9 points; of as many points of equal mass, if ``equal``."""
    random, d = np.random.default_rng(draw(SEEDS)), draw(dimensions)
    dtype = torch.float64 if random.random() < 0.75 else torch.float32
    scale = 10.0 ** int(random.choice(SCALES[dtype]))
    layout = str(random.choice(["plain", "strided", "transposed"]))
    n, ties, found = int(random.integers(1, 10)), random.random() < 0.3, []
    for _ in range(2):
        n = n if equal else int(random.integers(1, 10))
        points = random.standard_normal((n, d))
        points = np.round(points) if ties else points
        points[random.integers(n)] = points[0]  # coincident ones
        weights = np.ones(n) if equal or random.random() < 0.3 else random.integers(0, 4, n) * random.random(n)
        weights[random.integers(n)] = 1
        tensors = (strided(x, layout).to(dtype) for x in (points * scale, weights / weights.sum()))
        found.append(DiscreteMeasure(*tensors))
    return Pair(*found)


def in_double(measure: DiscreteMeasure) -> tuple[np.ndarray, np.ndarray]:
    """Points and masses of a measure, in double precision; the masses sum to one."""
    weights = measure.weights.double().numpy()
    return measure.points.double().numpy(), weights / weights.sum()


def line_cost(x: np.ndarray, y: np.ndarray, a: np.ndarray, b: np.ndarray, p: float) -> float:
    """Transport on a line: the quantile functions, step by step along all levels where either one jumps."""
    orders = np.argsort(x, kind="stable"), np.argsort(y, kind="stable")
    ends = np.cumsum(a[orders[0]]), np.cumsum(b[orders[1]])
    levels = np.sort(np.concatenate(ends))
    widths = np.diff(levels, prepend=0.0)
    middles = levels - widths / 2
    steps = (np.minimum(np.searchsorted(end, middles), len(end) - 1) for end in ends)
    gaps = np.abs(x[orders[0]][next(steps)] - y[orders[1]][next(steps)])
    return float((widths * gaps**p).sum())


@st.composite
def soups(draw) -> tuple[SurfaceMeasure, float]:
    """Loose triangles in space, some of them collapsed or coincident, and their size."""
    random = np.random.default_rng(draw(SEEDS))
    n, scale = int(random.integers(1, 7)), 10.0 ** int(random.choice([0, 0, -6, 6, -60, 60]))
    places = random.standard_normal((n + 3, 3))
    places = np.round(places) if random.random() < 0.4 else places
    if random.random() < 0.2:
        places[:] = places[0] + np.outer(random.random(len(places)), places[1])  # all on a line
    cells = np.array([random.permutation(n + 3)[:3] for _ in range(n)])
    if random.random() < 0.2:
        places[cells[0, 2]] = places[cells[0, 0]]  # coincident corners
    weights = random.random(n) + 0.1
    tensors = (torch.from_numpy(x) for x in (places * scale, cells, weights / weights.sum()))
    return SurfaceMeasure(*tensors), float(np.abs(places * scale).max())
