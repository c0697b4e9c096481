"""Additional coordinates besides the position: unit normals, features of vertices, features of faces."""

import dataclasses
import math
from collections.abc import Callable

import torch

from meshot.errors import as_floating
from meshot.mesh import Contour, Mesh
from meshot.mesh.geometry import edge_lengths, edge_normals, face_areas, face_normals
from meshot.types import Float, Int64, Tensor

Interpolation = Callable[[Tensor], Tensor]


@dataclasses.dataclass(frozen=True, eq=False)
class Extras:
    """Additional coordinates and their scales, validated against a shape.

    Every encoding orders its coordinates in the same way: position ‖ ``normal_scale`` · unit normal ‖
    ``feature_scale`` · features of the vertices ‖ ``feature_scale`` · features of the faces.

    Parameters
    ----------
    shape : Mesh or Contour
    normal_scale : float
        The length of a scaled unit normal, in units of the vertices.
    features, face_features : tensor, optional
        One row per vertex, and one row per face (or edge of a contour).
    feature_scale : float
        The length that corresponds to a feature difference of one, in units of the vertices per unit of the feature.

    Raises
    ------
    ValueError
        If a scale is negative or not finite, or features do not fit the shape.
    """

    shape: Mesh | Contour
    normal_scale: float
    features: Float[Tensor, "V k"] | None
    face_features: Float[Tensor, "F j"] | None
    feature_scale: float

    def __post_init__(self):
        for name, scale in (("normal_scale", self.normal_scale), ("feature_scale", self.feature_scale)):
            if not (scale >= 0 and math.isfinite(scale)):
                raise ValueError(
                    f"{name} is {scale!r}; a finite number >= 0 is needed, a length in units of the vertices"
                )
        vertices = self.shape.vertices
        for name, n_rows, kind in (
            ("features", len(vertices), "vertex"),
            ("face_features", len(cells_of(self.shape)), "face or edge"),
        ):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, _fitting(getattr(self, name), name, vertices, n_rows, kind))

    def at(self, interpolate: Interpolation, cells: Int64[Tensor, " k"], with_normals: bool) -> Float[Tensor, "n d"]:
        """The coordinates of positions on known cells.

        Parameters
        ----------
        interpolate : callable
            Maps values at the vertices, one row each, to values at the positions.
        cells : tensor
            The face or edge of every position. Used only for normals and for features of faces.
        with_normals : bool
            Whether the normal is one of the coordinates.
        """
        parts = [interpolate(self.shape.vertices)]
        if with_normals:
            is_contour = isinstance(self.shape, Contour)
            normals = edge_normals(self.shape) if is_contour else face_normals(self.shape)
            parts.append(self.normal_scale * normals[cells])
        if self.features is not None:
            parts.append(self.feature_scale * interpolate(self.features))
        if self.face_features is not None:
            parts.append(self.feature_scale * self.face_features[cells])
        return torch.cat(parts, dim=1)


def cells_of(shape: Mesh | Contour) -> Int64[Tensor, "F corners"]:
    """The faces of a mesh or the edges of a contour."""
    return shape.edges if isinstance(shape, Contour) else shape.faces


def cell_shares(shape: Mesh | Contour) -> Float[Tensor, " F"]:
    """The area of every face (or length of every edge) divided by the total: the probability of the cell.

    Raises
    ------
    ValueError
        If the total is zero.
    """
    sizes = edge_lengths(shape) if isinstance(shape, Contour) else face_areas(shape)
    total = sizes.sum()
    if not float(total.detach()) > 0:
        raise ValueError(
            f"the total area or length is {float(total.detach()):.3g}; a measure needs a shape of positive size"
        )
    return sizes / total


def _fitting(features: object, name: str, vertices: Tensor, n_rows: int, kind: str) -> Tensor:
    features = as_floating(features, name)
    if features.ndim != 2 or len(features) != n_rows or features.shape[1] == 0:
        raise ValueError(f"{name} has shape {tuple(features.shape)}; ({n_rows}, k) is needed, one row for each {kind}")
    if features.dtype != vertices.dtype or features.device != vertices.device:
        raise ValueError(
            f"{name} is {features.dtype} on {features.device}, vertices {vertices.dtype} on {vertices.device}: "
            "convert one with .to(...)"
        )
    return features
