"""The continuous encoding: the uniform distribution on a shape itself, without sampling."""

import dataclasses

import numpy as np
import torch

from meshot.errors import as_indices, as_points, require_same_space, require_shape
from meshot.measure.discrete import DiscreteMeasure, Extras, Measure, as_probabilities, cell_shares, cells_of, varifold
from meshot.mesh import Contour, Mesh
from meshot.types import Array, Float, Int64, Tensor


@dataclasses.dataclass(frozen=True, eq=False)
class SurfaceMeasure:
    """A distribution Σₖ wₖ · uniform(cell k) on triangles or segments in R^d, validated when it is created.

    The measure is hierarchical: a cell is drawn with probability wₖ, then a point uniformly in it. The triangles need
    not form a mesh in R³: they can, for example, have features as further coordinates.

    Parameters
    ----------
    vertices : tensor or array
        The corners, one row each.
    cells : tensor or array
        Integers, with three (triangles) or two (segments) vertex indices in each row. Corners at the same position are
        allowed: such a cell is an atom.
    weights : tensor or array
        The masses wₖ, non-negative with sum one. They are converted to the dtype of the vertices, and divided by their
        sum if it is within 1e-5 of one.

    Raises
    ------
    ValueError
        If an array is empty, has the wrong shape or dtype, or contains NaN; if a cell has the index of a vertex that
        does not exist, or the same index twice; if a weight is negative or the weights do not sum to one.

    Examples
    --------
    >>> import torch, meshot
    >>> corners = torch.tensor([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    >>> meshot.SurfaceMeasure(corners, torch.tensor([[0, 1], [1, 2]]), torch.tensor([0.5, 0.5]))
    SurfaceMeasure(2 segments on 3 vertices in R^2, torch.float32)
    """

    vertices: Float[Tensor, "V d"]
    cells: Int64[Tensor, "F corners"]
    weights: Float[Tensor, " F"]

    def __post_init__(self):
        vertices = as_points(self.vertices, "vertices")
        cells = as_indices(self.cells, "cells", vertices.shape[0]).to(vertices.device)
        require_shape(cells, "cells", None)
        if cells.shape[1] not in (2, 3):
            raise ValueError(f"cells has shape {tuple(cells.shape)}; (n, 3) triangles or (n, 2) segments are needed")
        repeated = (cells == cells.roll(1, dims=1)).any(dim=1)
        if bool(repeated.any()):
            raise ValueError(
                f"cells has {int(repeated.sum())} rows that name a vertex twice, the first is row "
                f"{int(repeated.nonzero()[0])}: remove them, or give them vertices of their own"
            )
        weights = as_probabilities(self.weights, vertices, len(cells))
        for name, value in (("vertices", vertices), ("cells", cells), ("weights", weights)):
            object.__setattr__(self, name, value)

    @property
    def places(self) -> Float[Tensor, "V d"]:
        """The corners. All classes that follow :class:`meshot.measure.Measure` have this attribute."""
        return self.vertices

    def to(self, *args: object, **kwargs: object) -> "SurfaceMeasure":
        """The same measure in another dtype or on another device (arguments as ``torch.Tensor.to``).

        Raises
        ------
        ValueError
            If the dtype is not floating point.
        """
        vertices = self.vertices.to(*args, **kwargs)
        return SurfaceMeasure(vertices, self.cells.to(vertices.device), self.weights.to(*args, **kwargs))

    def __repr__(self) -> str:
        n, d = self.vertices.shape
        kind = "triangles" if self.cells.shape[1] == 3 else "segments"
        return f"SurfaceMeasure({len(self.cells)} {kind} on {n} vertices in R^{d}, {self.vertices.dtype})"


def surface(
    shape: Mesh | Contour,
    *,
    normal_scale: float = 0.0,
    features: Float[Tensor, "V k"] | None = None,
    face_features: Float[Tensor, "F j"] | None = None,
    feature_scale: float = 1.0,
    detach_weights: bool = False,
) -> SurfaceMeasure:
    """The continuous measure of a shape: uniform by area (or length), with optional normals and features.

    A point of the shape is mapped to position ‖ ``normal_scale`` · unit normal ‖ ``feature_scale`` · features in R^d.
    Features of vertices are interpolated linearly. Normals and features of faces are constant on each face. The measure
    is differentiable with respect to the vertices, also through the weights, and to the features.

    Parameters
    ----------
    shape : Mesh or Contour
        Triangulate faces with more than three corners first, with :func:`meshot.triangulate`. The measure stays the
        same.
    normal_scale : float
        The length of a scaled unit normal, in units of the vertices. With vertices in mm and a scale of 10, reversing
        a face costs as much as moving it by 20 mm. With 0, the default of every encoding, normals are not part of the
        coordinates, because no single length suits meshes of every size.
    features : tensor, optional
        One row per vertex (colour, thickness).
    face_features : tensor, optional
        One row per face (or edge of a contour).
    feature_scale : float
        The length that corresponds to a feature difference of one, in units of the vertices per unit of the feature.
        With vertices in mm, colours in [0, 1] and a scale of 5, the difference between black and white costs as much as
        5 mm.
    detach_weights : bool
        Whether to stop the gradient through the areas, so that it flows only through the positions of the corners. By
        default, as in every encoding, the gradient is that of the whole measure, areas included.

    Raises
    ------
    ValueError
        If a scale is negative, features do not fit the shape, or the shape has zero area.

    Notes
    -----
    Without normals and face features, neighbouring cells share their corners. With them, every triangle has three
    corners of its own, because these coordinates are constant on faces.

    References
    ----------
    Le et al., ICLR 2024, Section 3.1, calls this the (hierarchical) continuous probability measure of a mesh.

    Examples
    --------
    >>> import meshot
    >>> from meshot.mesh.shapes import icosphere
    >>> meshot.surface(icosphere(1))
    SurfaceMeasure(80 triangles on 42 vertices in R^3, torch.float64)
    """
    extras = Extras(shape, normal_scale, features, face_features, feature_scale)
    cells, weights = cells_of(shape), cell_shares(shape)
    if normal_scale > 0 or face_features is not None:
        named, n_corners = cells.flatten(), cells.shape[1]
        owners = torch.arange(len(cells), device=cells.device).repeat_interleave(n_corners)
        vertices = extras.at(lambda values: values[named], owners, with_normals=normal_scale > 0)
        cells = torch.arange(len(vertices), device=cells.device).view(-1, n_corners)
    else:
        vertices = extras.at(lambda values: values, cells[:, 0], with_normals=False)
    return SurfaceMeasure(vertices, cells, weights.detach() if detach_weights else weights)


# Conversion of the arguments of a loss to measures.

#: The types that a loss accepts for each of its two measures.
MeasureLike = Measure | Mesh | Contour | Float[Tensor, "_ _"] | Float[Array, "_ _"]
#: For meshes of other packages, by the first part of the module name: how to convert them.
_FOREIGN = {"trimesh": "Mesh.from_trimesh(...)", "pyvista": "Mesh.from_pyvista(...)"}


def as_measures(source: MeasureLike, target: MeasureLike) -> tuple[Measure, Measure]:
    """Convert both arguments of a loss to measures in the same space.

    A measure is not changed. A :class:`meshot.Mesh` or :class:`meshot.Contour` becomes its continuous measure, uniform
    by area or length. A matrix of floating-point numbers, as an array or a tensor, becomes points of equal weight, one
    per row. A tensor keeps its gradient.

    Raises
    ------
    ValueError
        If an argument is of another type, or the two differ in dimension, dtype or device.
    """
    return _in_one_space(as_measure(source, "source"), as_measure(target, "target"))


def as_point_measures(source: MeasureLike, target: MeasureLike) -> tuple[Measure, Measure]:
    """Convert both arguments of a loss between point sets to measures of points in the same space.

    As :func:`as_measures`, but a mesh becomes the barycentres of its faces, weighted by area, and a contour the
    midpoints of its edges, weighted by length. These are the positions of its varifold.

    Raises
    ------
    ValueError
        As :func:`as_measures`, and for a continuous measure, which has no points.
    """
    return _in_one_space(as_point_measure(source, "source"), as_point_measure(target, "target"))


def as_measure(value: object, name: str) -> Measure:
    """Convert one argument of a loss, as :func:`meshot.measure.as_measures` does."""
    if isinstance(value, Measure):
        return value
    if isinstance(value, Mesh | Contour):
        return surface(value)
    if not isinstance(value, Tensor | np.ndarray):
        kind = type(value)
        package = "" if kind.__module__ == "builtins" else f"{kind.__module__.split('.')[0]}."
        plain = value is None or isinstance(value, bool | int | float | complex | str)
        said = repr(value) if plain else f"a {package}{kind.__qualname__}"
        remedy = "points go into numpy.asarray(..., dtype=float), a triangle mesh into Mesh(vertices, faces)"
        if kind.__module__.split(".")[0] in _FOREIGN:
            remedy = f"convert it by {_FOREIGN[kind.__module__.split('.')[0]]}"
        elif isinstance(value, list | tuple):
            remedy = "convert points by torch.tensor(...), or vertices and faces by Mesh(vertices, faces)"
        raise ValueError(
            f"{name} is {said}; a measure, a Mesh, a Contour, or an (n, d) array or tensor of floating-point numbers "
            f"is needed, or a batch of them: {remedy}"
        )
    points = as_points(value, name)
    return DiscreteMeasure(points)


def as_point_measure(value: object, name: str) -> Measure:
    """Convert one argument of a loss between point sets, as :func:`meshot.measure.as_point_measures` does."""
    if isinstance(value, Mesh | Contour):
        return varifold(value)
    measure = as_measure(value, name)
    if measure.cells is not None:
        raise ValueError(
            f"{name} is a continuous measure, {value!r}; this loss compares points: draw them by "
            "meshot.empirical(mesh, n_points, generator=0), or pass the Mesh itself for the barycentres of its faces"
        )
    return measure


def _in_one_space(source: Measure, target: Measure) -> tuple[Measure, Measure]:
    require_same_space(source.places, target.places)
    return source, target
