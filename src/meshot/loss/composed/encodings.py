"""Encodings of a mesh as a measure, by name, each with settings of its own."""

import abc
import dataclasses
import math
from typing import ClassVar

import numpy as np

from meshot.errors import require_positive_integer
from meshot.measure import DiscreteMeasure, Measure, SurfaceMeasure, empirical, surface, varifold, varifold_sample
from meshot.mesh import Mesh


class Encoding(abc.ABC):
    """A way from a mesh to a measure; a frozen dataclass, whose fields are its settings.

    Attributes
    ----------
    continuous : bool
        Whether the measure has no supports, so that only some losses take it.
    """

    continuous: ClassVar[bool] = False

    @abc.abstractmethod
    def measure(self, mesh: Mesh, n_default: int, generator: np.random.Generator) -> Measure:
        """The encoding of a mesh, with ``n_default`` supports where a number is needed and none is set."""


@dataclasses.dataclass(frozen=True)
class VarifoldEncoding(Encoding):
    """The oriented varifold: see :func:`meshot.varifold`.

    Parameters
    ----------
    n_supports : int, optional
        So many faces are drawn anew at every call; all faces if left out.
    normal_scale : float
        The length of a unit normal, in mm; at zero, the default of every encoding, normals are not compared. The paper
        has 1 and names no unit.
    detach_weights : bool
        Stop the gradient through the areas; by default, as in every encoding, it goes through them.

    Raises
    ------
    ValueError
        If a number is outside its range.
    """

    n_supports: int | None = None
    normal_scale: float = 0.0
    detach_weights: bool = False

    def __post_init__(self):
        _require_supports(self.n_supports)
        if not isinstance(self.detach_weights, bool):
            raise ValueError(f"detach_weights is {self.detach_weights!r}; true or false is needed")
        if not 0 <= self.normal_scale < math.inf:
            raise ValueError(f"normal_scale is {self.normal_scale!r}; a length >= 0 is needed, in mm")

    def measure(self, mesh: Mesh, n_default: int, generator: np.random.Generator) -> DiscreteMeasure:
        """The varifold of all faces, or of those drawn."""
        if self.n_supports is None:
            return varifold(mesh, normal_scale=self.normal_scale, detach_weights=self.detach_weights)
        return varifold_sample(
            mesh, self.n_supports, generator, normal_scale=self.normal_scale, detach_weights=self.detach_weights
        )


@dataclasses.dataclass(frozen=True)
class SampleEncoding(Encoding):
    """Points drawn by area, without normals or a gradient in their masses: see :func:`meshot.empirical`.

    Parameters
    ----------
    n_supports : int, optional
        So many points are drawn anew at every call; as many as the source has faces if left out.

    Raises
    ------
    ValueError
        If the number is not a positive integer.
    """

    n_supports: int | None = None

    def __post_init__(self):
        _require_supports(self.n_supports)

    def measure(self, mesh: Mesh, n_default: int, generator: np.random.Generator) -> DiscreteMeasure:
        """The points."""
        return empirical(mesh, self.n_supports or n_default, generator, detach_weights=True)


@dataclasses.dataclass(frozen=True)
class SurfaceEncoding(Encoding):
    """The continuous surface, without normals: see :func:`meshot.surface`."""

    continuous: ClassVar[bool] = True

    def measure(self, mesh: Mesh, n_default: int, generator: np.random.Generator) -> SurfaceMeasure:
        """The measure of the surface; nothing is drawn."""
        return surface(mesh)


def _require_supports(n_supports: int | None) -> None:
    if n_supports is not None:
        require_positive_integer(n_supports, "n_supports")


#: Every encoding by the name that settings give it.
ENCODINGS: dict[str, type[Encoding]] = {
    "varifold": VarifoldEncoding, "samples": SampleEncoding, "surface": SurfaceEncoding,
}  # fmt: skip
