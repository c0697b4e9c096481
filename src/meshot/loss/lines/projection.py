"""The distribution of a measure projected on a line, as used by the exact loss, for plots and checks."""

import dataclasses

import numpy as np
import torch

from meshot.loss.directions import require_directions
from meshot.loss.exact import laid_law
from meshot.measure import Measure
from meshot.types import Array, Float, Tensor


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

    The density of a triangle is piecewise linear, that of a segment is constant. A point, or a face perpendicular to
    the direction, gives an atom. No sampling, no gradient.

    Parameters
    ----------
    measure : Measure
    direction : tensor
        A unit vector θ.

    Raises
    ------
    ValueError
        If the direction does not fit the measure or does not have unit length.

    Notes
    -----
    O((F + V) log V) time.
    """
    row = require_directions(torch.as_tensor(direction)[None], measure.places)
    starts, extents, masses, changes = (values[:-1] for values in laid_law(measure, row[0]))
    means = np.divide(masses, extents, out=np.zeros_like(masses), where=extents > 0)
    densities = means[:, None] * (1 + changes[:, None] * np.array([-1.0, 1.0]))
    return ProjectedLaw(starts, extents, masses, densities)
