"""The kernel norm of the difference of two varifolds, the classic loss of surface matching."""

import dataclasses
import functools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
from scipy.spatial import cKDTree
from torch.utils.checkpoint import checkpoint

from meshot.errors import require_choice, require_positive
from meshot.loss._kernel_pairs import BLOCK, sum_kernel
from meshot.loss.autograd import public_loss, solved
from meshot.loss.sliced import takes_kernel
from meshot.measure import Measure, MeasuresLike, as_pairs
from meshot.types import Array, Float, Tensor
from meshot.workers import in_chunks


class Angular(NamedTuple):
    """A kernel of two unit normals with the scalar product u: exp(−s (1 − u)) (c₀ + c₁ u + c₂ u²)."""

    sharpness: float
    constant: float
    linear: float
    square: float

    def of(self, u: Tensor) -> Tensor:
        """The values of the kernel."""
        return (self.sharpness * (u - 1)).exp() * (self.constant + u * (self.linear + u * self.square))


#: Kernels of two unit normals by name.
ANGULAR = {
    "currents": Angular(0.0, 0.0, 1.0, 0.0),
    "varifold": Angular(0.0, 0.0, 0.0, 1.0),
    "oriented": Angular(8.0, 1.0, 0.0, 0.0),
}
_BLOCK = 1 << 22  # pairs of points per block


@public_loss
def varifold_kernel(
    source: MeasuresLike,
    target: MeasuresLike,
    width: float = 5.0,
    angular: str = "oriented",
    *,
    reduction: str = "none",
) -> Float[Tensor, "*B"]:
    """The squared kernel norm ‖μ − ν‖² of the difference of two varifolds.

    The inner product of two varifolds is Σᵢⱼ aᵢ bⱼ exp(−‖xᵢ − yⱼ‖²/w²) γ(mᵢ · nⱼ), with masses aᵢ and bⱼ, positions xᵢ
    and yⱼ, unit normals mᵢ and nⱼ, and the width w. The norm compares both surfaces within a distance of about w.
    Surfaces farther apart than a few widths do not attract each other.

    Parameters
    ----------
    source, target : measure, or a batch of them
        Points in R⁶ with positive length of the last three coordinates: a position and a scaled normal, as
        :func:`meshot.varifold` makes them with ``normal_scale`` > 0. Only the direction of the normal counts.
    width : float
        The width w of the Gaussian in space, in units of the positions.
    angular : str
        The kernel γ of two normals: ``"currents"`` (u), in which opposite normals cancel; ``"varifold"`` (u²), which
        does not depend on orientation; ``"oriented"`` (exp(2 (u − 1)/σ²) with σ = ½), in which opposite normals neither
        cancel nor match.
    reduction : str
        Of a batch: "none" for a value per pair, "mean" for their mean.

    Returns
    -------
    tensor
        Without unit, since the masses sum to one: at most 4. It is zero between equal varifolds.

    Raises
    ------
    ValueError
        If the measures are not of points in R⁶, a normal has length zero, the width is not positive, or the kernel is
        unknown.

    Notes
    -----
    O(n m) time and O(n + m) memory. On a CPU, in float32 or float64, compiled kernels compute the value and the
    gradient. They leave out pairs whose Gaussian is below the rounding error of the dtype, which lie more than 4 widths
    apart in float32 and 6 in float64. Otherwise PyTorch computes blocks of pairs, twice for the gradient. The masses
    are normalised, in contrast to the cited papers, where they are areas.

    References
    ----------
    Charon and Trouvé, *The varifold representation of nonoriented shapes for diffeomorphic registration*, SIAM J.
    Imaging Sciences 2013; Kaltenmark, Charlier and Charon, *A general framework for curve and surface comparison and
    registration with oriented varifolds*, CVPR 2017.

    Examples
    --------
    >>> import torch, meshot
    >>> up = torch.tensor([[0.0, 0.0, 0.0, 0.0, 0.0, 1.0]])
    >>> apart = up + torch.tensor([[1.0, 0.0, 0.0, 0.0, 0.0, 0.0]])
    >>> from meshot.loss import varifold_kernel
    >>> found = varifold_kernel(meshot.DiscreteMeasure(up), meshot.DiscreteMeasure(apart), width=1.0)
    >>> round(float(found), 4)  # 2 (1 − 1/e)
    1.2642
    """
    pairs = as_pairs(source, target, of_points=True, reduction=reduction)
    require_positive(width, "width", "units of the positions")
    require_choice(angular, "angular", ANGULAR)
    kernel, oriented = ANGULAR[angular], []
    for pair in pairs.items:
        # Squared distances are more accurate near the origin. Points without mass do not count.
        places, massive = pair[1].places.detach(), pair[1].weights > 0
        middle = (places if bool(massive.all()) else places[massive])[:, :3].mean(dim=0)
        oriented.append([each for measure in pair for each in _oriented_points(measure, middle / width, width)])
    if takes_kernel(pairs.like):
        return pairs.reduced(fused_norms(oriented, kernel))
    return pairs.reduced([_plain_norm(tensors, kernel) for tensors in oriented])


def _plain_norm(tensors: Sequence[Tensor], kernel: Angular) -> Float[Tensor, ""]:
    """The squared norm of the difference by PyTorch operations."""
    first, second = tensors[:3], tensors[3:]
    own = sum(_inner(*side, *side, kernel) for side in (first, second))
    return own - 2 * _inner(*first, *second, kernel)


def _oriented_points(measure: Measure, middle: Tensor, width: float) -> tuple[Tensor, Tensor, Tensor]:
    """Positions in widths, unit normals, and masses."""
    if measure.places.shape[1] != 6:
        raise ValueError(
            f"the points lie in R^{measure.places.shape[1]}; R^6 is needed, a position and a normal: encode the mesh "
            "with varifold(mesh, normal_scale=1.0)"
        )
    positions, normals = measure.places[:, :3] / width - middle, measure.places[:, 3:]
    lengths = normals.norm(dim=1, keepdim=True)
    flat = (lengths[:, 0] == 0) & (measure.weights > 0)
    if bool(flat.any()):
        raise ValueError(
            f"{int(flat.sum())} normals have length zero; positive lengths are needed: encode the mesh with "
            "varifold(mesh, normal_scale=1.0)"
        )
    return positions, normals / torch.where(lengths > 0, lengths, 1.0), measure.weights


def _inner(x: Tensor, m: Tensor, a: Tensor, y: Tensor, n: Tensor, b: Tensor, kernel: Angular) -> Float[Tensor, ""]:
    """The inner product of two varifolds, block by block."""
    rows = max(1, _BLOCK // len(y))
    blocks = zip(x.split(rows), m.split(rows), a.split(rows), strict=True)
    return sum(checkpoint(_block, *block, y, n, b, kernel, use_reentrant=False) for block in blocks)


def _block(x: Tensor, m: Tensor, a: Tensor, y: Tensor, n: Tensor, b: Tensor, kernel: Angular) -> Float[Tensor, ""]:
    squared = x.square().sum(dim=1)[:, None] + y.square().sum(dim=1) - 2 * x @ y.T
    return a @ ((-squared).exp() * kernel.of(m @ n.T)) @ b


# The kernel norm computed by the kernels: order of the points, division into threads, gradients.

_PIECE = 256  # number of points whose sums one thread computes at a time


def fused_norms(pairs: Sequence[Sequence[Tensor]], angular: Angular) -> Float[Tensor, " B"]:
    """The squared kernel norm of every difference, from positions, normals and masses of both sides."""
    reach = math.sqrt(-math.log(torch.finfo(pairs[0][0].dtype).eps))  # a kernel farther apart is below rounding

    def solve(_: int, tensors: Sequence[Tensor], wanted: Sequence[bool], n_threads: int) -> tuple[float, list]:
        sides, wants = (_side(*tensors[:3]), _side(*tensors[3:])), (any(wanted[:3]), any(wanted[3:]))
        sums = functools.partial(_sums, angular=angular, reach=reach, n_threads=n_threads)
        own = [_own(side, sums, want) for side, want in zip(sides, wants)]
        cross = [sums(*sides, gradient=wants[0]), sums(*sides[::-1], gradient=True) if wants[1] else None]
        gradients = []
        for side, mine, other, want in zip(sides, own, cross, wants):
            gradients += _gradients(side, mine, other) if want else (None, None, None)
        values = [side.masses @ each.values for side, each in zip((*sides, sides[0]), (*own, cross[0]))]
        return values[0] + values[1] - 2 * values[2], gradients

    return solved(solve, pairs, lambda _, *tensors: _plain_norm(tensors, angular))


@dataclasses.dataclass(frozen=True, eq=False)
class _Side:
    """One measure in the format of the kernels: neighbours in space are neighbours in memory."""

    rows: Float[Array, "6 n"]
    masses: Float[Array, " n"]
    order: Array
    low: Float[Array, "3 blocks"]
    high: Float[Array, "3 blocks"]


@dataclasses.dataclass(frozen=True, eq=False)
class _Sums:
    """For every point of a side, the sum of the kernel over the points of a side, and its gradient if needed."""

    values: Float[Array, " n"]
    gradients: Float[Array, "6 n"] | None


def _side(positions: Tensor, normals: Tensor, masses: Tensor) -> _Side:
    columns, weights = (t.detach().double().numpy() for t in (torch.cat([positions, normals], dim=1), masses))
    order = cKDTree(columns[:, :3]).indices  # leaf by leaf
    rows, starts = np.ascontiguousarray(columns[order].T), np.arange(0, len(order), BLOCK)
    low, high = (extreme.reduceat(rows[:3], starts, axis=1) for extreme in (np.minimum, np.maximum))
    return _Side(rows, np.ascontiguousarray(weights[order]), order, low, high)


def _sums(
    side: _Side,
    other: _Side,
    *,
    angular: Angular,
    reach: float,
    n_threads: int,
    gradient: bool,
    above: bool = False,
) -> _Sums:
    """The sums over the other side. Pieces of fixed size make them the same for any number of threads."""
    n = len(side.masses)
    values, gradients = np.zeros(n), np.zeros((6, n) if gradient else (0, 0))

    def work(first: int, last: int) -> None:
        for start in range(first * _PIECE, min(last * _PIECE, n), _PIECE):
            bounds = side.rows, start, min(start + _PIECE, n)
            onto = other.rows, other.masses, other.low, other.high
            sum_kernel(*bounds, *onto, reach, angular, above, values, gradients)

    in_chunks(work, -(-n // _PIECE), n_threads=n_threads)
    return _Sums(values, gradients if gradient else None)


def _own(side: _Side, sums: functools.partial, gradient: bool) -> _Sums:
    """The sums over the side itself. Without a gradient, each pair is computed once and counted twice."""
    if gradient:
        return sums(side, side, gradient=True)
    after = sums(side, side, gradient=False, above=True)
    of_itself = sum(sums.keywords["angular"][1:])  # the kernel of a point with itself
    return _Sums(2 * after.values + of_itself * side.masses, None)


def _gradients(side: _Side, own: _Sums, cross: _Sums) -> tuple[Array, Array, Array]:
    """In positions, normals and masses, in the original order of the points."""
    rows, masses = np.empty_like(own.gradients.T), np.empty_like(side.masses)
    rows[side.order] = (2 * side.masses * (own.gradients - cross.gradients)).T
    masses[side.order] = 2 * (own.values - cross.values)
    return rows[:, :3], rows[:, 3:], masses
