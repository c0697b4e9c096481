"""The continuous encoding: a shape as the uniform law on itself, not on points drawn from it."""

import dataclasses

import torch

from meshot.errors import as_floating, as_indices, require_shape
from meshot.measure.coordinates import Extras, cell_shares, cells_of
from meshot.measure.probabilities import as_probabilities
from meshot.mesh import Contour, Mesh
from meshot.types import Float, Int64, Tensor


@dataclasses.dataclass(frozen=True, eq=False)
class SurfaceMeasure:
    """Mass spread evenly over triangles (or segments) in R^d: Σₖ wₖ · uniform law on cell k, validated at the door.

    The measure is hierarchical: draw a cell with probability wₖ, then a point uniformly in it. Triangles that are
    shared by no mesh in R³, such as those lifted by features, are as good as any.

    Parameters
    ----------
    vertices : tensor or array
        The corners, one row each.
    cells : tensor or array
        Integers, three (triangles) or two (segments) corners in each row. Their places may coincide: an atom.
    weights : tensor or array
        The masses wₖ, each at least zero, that sum to one. They are given the dtype of the vertices, and are divided by
        their sum if it is within 1e-5 of one.

    Raises
    ------
    ValueError
        If an array is empty, has another shape or dtype, or holds NaN; if a cell names a vertex that does not exist,
        or one twice; if a weight is negative or the weights do not sum to one.

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
        vertices = as_floating(self.vertices, "vertices")
        require_shape(vertices, "vertices", None)
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
        """The corners, under the name that every :class:`meshot.measure.Measure` has for them."""
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
    """The continuous measure of a shape: uniform by area (or length), with normals or features as further coordinates.

    A point of the shape becomes position ‖ ``normal_scale`` · unit normal ‖ ``feature_scale`` · features in R^d, where
    features of the vertices are interpolated linearly and normals and features of the faces are constant on each face.
    Differentiable in the vertices, weights included, and in the features.

    Parameters
    ----------
    shape : Mesh or Contour
        Faces with more than three corners: cut them first, by :func:`meshot.triangulate`; the measure stays the same.
    normal_scale : float
        The length given to a unit normal, in units of the vertices: with vertices in mm and a scale of 10, turning a
        face around costs as much as moving it by 20 mm. At zero, the default of every encoding, there are no such
        coordinates, since no length suits a mesh in mm and one of unit size alike.
    features : tensor, optional
        A row for each vertex (colour, thickness).
    face_features : tensor, optional
        A row for each face (or edge of a contour).
    feature_scale : float
        The length that a difference of one in a feature is worth, in units of the vertices per unit of the feature:
        with vertices in mm, colours in [0, 1] and a scale of 5, black against white costs as much as 5 mm.
    detach_weights : bool
        Stop the gradient through the areas, so that only the places of the corners carry it. By default, as in every
        encoding, it goes through them too and is that of the whole measure.

    Raises
    ------
    ValueError
        If a scale is negative, features do not fit the shape, or the shape has no area.

    Notes
    -----
    Without coordinates that are constant on faces, faces share their corners. With them every face has its own: d is
    larger, and there are three corners for each triangle.

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
