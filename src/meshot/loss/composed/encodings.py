"""Encodings of a mesh as a measure, selected by name, with their settings."""

import abc
import dataclasses
import math
from typing import ClassVar

import numpy as np

from meshot.errors import require_positive_integer
from meshot.measure import DiscreteMeasure, Measure, SurfaceMeasure, empirical, surface, varifold, varifold_sample
from meshot.mesh import Mesh


class Encoding(abc.ABC):
    """An encoding of a mesh as a measure: a frozen dataclass whose fields are its settings.

    Attributes
    ----------
    continuous : bool
        Whether the measure has no support points. Only some losses accept such measures.
    """

    continuous: ClassVar[bool] = False

    @abc.abstractmethod
    def measure(self, mesh: Mesh, n_default: int, generator: np.random.Generator) -> Measure:
        """The measure of a mesh. ``n_default`` is the number of support points if one is needed and not set."""


@dataclasses.dataclass(frozen=True)
class VarifoldEncoding(Encoding):
    """The oriented varifold: see :func:`meshot.varifold`.

    Parameters
    ----------
    n_supports : int, optional
        Number of faces drawn in every call. By default all faces are used.
    normal_scale : float
        The length of a scaled unit normal, in mm. With 0, the default of every encoding, normals are not compared. The
        paper uses 1 and states no unit.
    detach_weights : bool
        Whether to stop the gradient through the areas. By default, as in every encoding, it includes them.

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
        _require_bool(self.detach_weights)
        if not 0 <= self.normal_scale < math.inf:
            raise ValueError(f"normal_scale is {self.normal_scale!r}; a length >= 0 is needed, in mm")

    def measure(self, mesh: Mesh, n_default: int, generator: np.random.Generator) -> DiscreteMeasure:
        """The varifold of all faces, or of the drawn ones."""
        if self.n_supports is None:
            return varifold(mesh, normal_scale=self.normal_scale, detach_weights=self.detach_weights)
        return varifold_sample(
            mesh, self.n_supports, generator, normal_scale=self.normal_scale, detach_weights=self.detach_weights
        )


@dataclasses.dataclass(frozen=True)
class SampleEncoding(Encoding):
    """Points drawn by area, without normals: see :func:`meshot.empirical`.

    Parameters
    ----------
    n_supports : int, optional
        Number of points drawn in every call. The default is the number of faces of the source.
    detach_weights : bool
        Whether to stop the gradient of the masses. By default it is stopped, as in most implementations.

    Raises
    ------
    ValueError
        If the number is not a positive integer, or ``detach_weights`` is not a bool.
    """

    n_supports: int | None = None
    detach_weights: bool = True

    def __post_init__(self):
        _require_supports(self.n_supports)
        _require_bool(self.detach_weights)

    def measure(self, mesh: Mesh, n_default: int, generator: np.random.Generator) -> DiscreteMeasure:
        """The empirical measure."""
        return empirical(mesh, self.n_supports or n_default, generator, detach_weights=self.detach_weights)


@dataclasses.dataclass(frozen=True)
class SurfaceEncoding(Encoding):
    """The continuous surface, without normals: see :func:`meshot.surface`."""

    continuous: ClassVar[bool] = True

    def measure(self, mesh: Mesh, n_default: int, generator: np.random.Generator) -> SurfaceMeasure:
        """The continuous measure. Nothing is random."""
        return surface(mesh)


def _require_bool(detach_weights: bool) -> None:
    if not isinstance(detach_weights, bool):
        raise ValueError(f"detach_weights is {detach_weights!r}; true or false is needed")


def _require_supports(n_supports: int | None) -> None:
    if n_supports is not None:
        require_positive_integer(n_supports, "n_supports")


#: The encodings by name.
ENCODINGS: dict[str, type[Encoding]] = {
    "varifold": VarifoldEncoding, "samples": SampleEncoding, "surface": SurfaceEncoding,
}  # fmt: skip
