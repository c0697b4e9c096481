"""The sliced Wasserstein loss of continuous measures without sampling, exact along every direction."""

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
import torch

from meshot.loss import _kernel_exact
from meshot.loss.autograd import solved
from meshot.loss.directions import require_directions
from meshot.measure import Measure
from meshot.types import Array, Float, Tensor
from meshot.workers import in_chunks


def exact_sliced_wasserstein(
    pairs: Sequence[tuple[Measure, Measure]], directions: Float[Tensor, "L d"], p: float = 2
) -> Float[Tensor, " B"]:
    """The sliced Wasserstein loss SW_p^p for p = 1 or 2, from the exact distribution of every projected triangle."""
    # It is the mean over ``directions`` of the 1D transport cost between the projected measures, for every pair. Each
    # cost is exact up to roundoff, also for faces perpendicular to a direction. Differentiable with respect to the
    # vertices (or points) and the weights, but not the directions.
    _require_exact(directions, p)
    rows = _array(directions)

    def solve(
        k: int, tensors: Sequence[Tensor], wanted: Sequence[bool], n_threads: int
    ) -> tuple[float, list[Float[Array, "..."]]]:
        places, weights, places_target, weights_target = tensors
        unit = _unit(places, places_target, int(p))
        source = _side(places, weights, pairs[k][0].cells, any(wanted[:2]), unit)
        target = _side(places_target, weights_target, pairs[k][1].cells, any(wanted[2:]), unit)
        parts = in_chunks(lambda i, j: _costs(source, target, rows[i:j], int(p)), len(rows), n_threads=n_threads)
        powers = (unit ** (p - 1), unit**p) * 2
        gradients = [sum(part[1 + i] for part in parts) / len(rows) * power for i, power in enumerate(powers)]
        return np.concatenate([part[0] for part in parts]).mean() * unit**p, gradients

    return solved(solve, [(s.places, s.weights, t.places, t.weights) for s, t in pairs])


def exact_slice_costs(
    source: Measure, target: Measure, directions: Float[Tensor, "L d"], p: float = 2
) -> Float[Tensor, " L"]:
    """The exact cost W_p^p along every direction, without gradient."""
    # Arguments and errors are those of :func:`meshot.loss.exact.exact_sliced_wasserstein`, the mean of these costs.
    _require_exact(directions, p)
    unit = _unit(source.places, target.places, int(p))
    sides = [_side(m.places, m.weights, m.cells, False, unit) for m in (source, target)]
    rows = _array(directions)
    parts = in_chunks(lambda start, stop: _costs(*sides, rows[start:stop], int(p))[0], len(rows))
    return torch.from_numpy(np.concatenate(parts) * unit ** int(p)).to(source.places)


def _require_exact(directions: Tensor, p: float) -> None:
    if directions.requires_grad:
        raise ValueError(
            "directions requires a gradient; the exact loss has none in the directions: pass directions.detach(), or "
            "sample both surfaces with meshot.empirical"
        )
    if p not in (1, 2):
        raise ValueError(
            f"p is {p!r}; between continuous measures transport is computed exactly for p = 1 and 2: take one of "
            "these, or sample both surfaces with meshot.empirical for another exponent"
        )


@dataclasses.dataclass(frozen=True, eq=False)
class _Side:
    """One measure as arrays. ``cells`` is None for points."""

    places: Float[Array, "d V"]
    weights: Float[Array, " n"]
    cells: Array | None
    wanted: bool


def _side(places: Tensor, weights: Tensor, cells: Tensor | None, wanted: bool, unit: float = 1.0) -> _Side:
    corners = None if cells is None else np.ascontiguousarray(cells.cpu().numpy())
    return _Side(np.ascontiguousarray(_array(places).T / unit), _array(weights), corners, wanted)


def _unit(places: Tensor, others: Tensor, p: int) -> float:
    """The power of two next to the largest coordinate, as a unit in which powers do not exceed the range of float64."""
    largest = max(float(np.abs(_array(each)).max()) for each in (places, others))
    digits = math.frexp(largest)[1] - 1
    if p * digits > 1023:
        raise ValueError(
            f"coordinates reach {largest:.3g}, and their power {p} exceeds float64: scale both measures down"
        )
    return math.ldexp(1.0, digits)


def _array(values: Tensor) -> Array:
    return np.ascontiguousarray(values.detach().cpu().to(torch.float64).numpy())


class _Line:
    """Buffers for the projection of one side: distribution and gradient, reused for every direction."""

    def __init__(self, side: _Side):
        self.side = side
        n_places = side.places.shape[1]
        n_cells = n_places if side.cells is not None else 2 * n_places + 1  # including the sentinel
        size = 1 << max(n_cells - 2, 0).bit_length()
        n_nodes = 2 * size if side.cells is not None else 0
        self.law = tuple(np.empty(n_cells) for _ in range(4))
        self.rank = np.empty(n_places, np.int64)
        self.tree = np.empty((n_nodes, 2))
        self.jumps = np.empty((n_places, 2))
        self.moments = np.zeros((n_cells, 3))
        self.work: tuple[Array, ...] = ()
        if side.wanted:  # the potential, and for a surface also pieces, levels and the sparse table
            self.work = (np.empty(n_cells),)
            if side.cells is not None:
                n_pieces, n_levels = 2 * len(side.cells), n_cells.bit_length() + 1
                shapes = ((n_pieces, 2), n_pieces, n_levels + 2, n_levels)
                integers = [np.empty(shape, np.int64) for shape in shapes]
                self.work = (*integers, np.empty((n_cells, 3)), np.empty((n_pieces, 2)), *self.work)
        self.to_projected = np.empty(n_places)
        self.to_places = np.zeros_like(side.places)
        self.to_weights = np.zeros_like(side.weights)

    def lay(self, direction: Float[Array, " d"]) -> None:
        """Project the measure, sort the projections, and compute the distribution."""
        projected = np.einsum("dv,d->v", self.side.places, direction)
        self.order = np.argsort(projected)
        self.moments[:] = 0
        if self.side.cells is None:
            _kernel_exact.lay_points(projected, self.order, self.side.weights, *self.law)
        else:
            _kernel_exact.lay_surface(
                projected, self.order, self.side.cells, self.side.weights, self.rank, self.tree, self.jumps, *self.law
            )

    def add_gradient(self, direction: Float[Array, " d"]) -> None:
        """Add the gradient for this direction."""
        if self.side.cells is None:
            _kernel_exact.points_gradient(
                self.law, self.moments, self.order, self.side.weights, *self.work, self.to_projected, self.to_weights
            )
        else:
            into = self.to_projected, self.to_weights
            _kernel_exact.surface_gradient(
                self.law, self.moments, self.side.cells, self.side.weights, self.rank, self.work, *into
            )
        self.to_places += direction[:, None] * self.to_projected


def _costs(source: _Side, target: _Side, directions: Float[Array, "L d"], p: int) -> tuple[Array, ...]:
    """The costs along some directions, and the sums of their gradients in positions and weights of both sides."""
    lines = _Line(source), _Line(target)
    wanted = (source.wanted, target.wanted)
    costs = np.empty(len(directions))
    for k, direction in enumerate(directions):
        for line in lines:
            line.lay(direction)
        costs[k] = _kernel_exact.walk(p, lines[0].law, lines[1].law, wanted, lines[0].moments, lines[1].moments)
        for line in lines:
            if line.side.wanted:
                line.add_gradient(direction)
    return costs, *(part for line in lines for part in (line.to_places.T, line.to_weights))


# The distribution of a measure projected on a line, as used by the exact loss, for plots and checks.


@dataclasses.dataclass(frozen=True, eq=False)
class ProjectedLaw:
    """A probability distribution on a line: intervals with linear density, and atoms.

    Parameters
    ----------
    starts, extents : array
        Start and length of the intervals, from left to right. An interval of length zero is an atom.
    masses : array
        Masses of the intervals and atoms, with sum one.
    densities : array
        Densities at the start and the end of every interval, in 1/(unit of length); zero at atoms.
    """

    starts: Float[Array, " n"]
    extents: Float[Array, " n"]
    masses: Float[Array, " n"]
    densities: Float[Array, "n 2"]

    @property
    def atoms(self) -> tuple[Float[Array, " k"], Float[Array, " k"]]:
        """Positions and masses of the atoms."""
        chosen = (self.extents == 0) & (self.masses > 0)
        places = np.unique(self.starts[chosen])
        return places, np.array([self.masses[chosen & (self.starts == place)].sum() for place in places])

    def density(self, x: Float[Array, " k"]) -> Float[Array, " k"]:
        """The density at every x, without atoms; zero outside the support."""
        wide = self.extents > 0
        starts, extents, ends = self.starts[wide], self.extents[wide], self.densities[wide]
        if len(starts) == 0:
            return np.zeros_like(x)
        at = np.maximum(np.searchsorted(starts, x, side="right") - 1, 0)
        share = (x - starts[at]) / extents[at]
        inside = (share >= 0) & (share <= 1)
        return np.where(inside, ends[at, 0] + (ends[at, 1] - ends[at, 0]) * np.clip(share, 0, 1), 0.0)

    def distribution(self, x: Float[Array, " k"]) -> Float[Array, " k"]:
        """The distribution function F(x): the mass at or to the left of every x."""
        below = np.concatenate([[0.0], np.cumsum(self.masses)])
        at = np.searchsorted(self.starts, x, side="right") - 1
        first = np.maximum(at, 0)
        reach = np.clip(x - self.starts[first], 0, self.extents[first])
        change = np.divide(
            self.densities[first, 1] - self.densities[first, 0],
            self.extents[first],
            out=np.zeros_like(reach),
            where=self.extents[first] > 0,
        )
        part = reach * (self.densities[first, 0] + change * reach / 2)
        part = np.where(self.extents[first] > 0, np.minimum(part, self.masses[first]), self.masses[first])
        return np.where(at >= 0, np.minimum(below[first] + part, 1.0), 0.0)


def projected_law(measure: Measure, direction: Float[Tensor, " d"]) -> ProjectedLaw:
    """The exact distribution of ⟨θ, X⟩ for X drawn from a measure, as used by :func:`meshot.sliced_wasserstein`.

    The direction is a unit vector θ. The density of a triangle is piecewise linear, that of a segment is constant. A
    point, or a face perpendicular to the direction, gives an atom. No sampling, no gradient.

    Raises
    ------
    ValueError
        If the direction does not fit the measure or does not have unit length.

    Notes
    -----
    O((F + V) log V) time.
    """
    row = require_directions(torch.as_tensor(direction)[None], measure.places)
    line = _Line(_side(measure.places, measure.weights, measure.cells, False))
    line.lay(_array(row[0]))
    starts, extents, masses, changes = (values[:-1] for values in line.law)  # the last cell is a sentinel
    means = np.divide(masses, extents, out=np.zeros_like(masses), where=extents > 0)
    densities = means[:, None] * (1 + changes[:, None] * np.array([-1.0, 1.0]))
    return ProjectedLaw(starts, extents, masses, densities)
