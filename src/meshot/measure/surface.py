"""The continuous encoding: a shape as the uniform law on itself, not on points drawn from it."""

import dataclasses

import torch

from meshot.errors import as_floating, as_indices, require_shape
from meshot.measure.discrete import normalised, require_probabilities
from meshot.mesh.geometry import edge_lengths, edge_normals, face_areas, face_normals
from meshot.mesh.mesh import Contour, Mesh
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
        The masses wₖ, each at least zero, that sum to one.

    Raises
    ------
    ValueError
        If an array is empty, has another shape or dtype, or holds NaN; if a cell names a vertex that does not exist,
        or one twice; if a weight is negative or the weights do not sum to one.
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
        weights = as_floating(self.weights, "weights")
        require_probabilities(weights, vertices, len(cells))
        for name, value in (("vertices", vertices), ("cells", cells), ("weights", weights)):
            object.__setattr__(self, name, value)

    def __repr__(self) -> str:
        n, d = self.vertices.shape
        kind = "triangles" if self.cells.shape[1] == 3 else "segments"
        return f"SurfaceMeasure({len(self.cells)} {kind} on {n} vertices in R^{d}, {self.vertices.dtype})"


def surface(
    shape: Mesh | Contour,
    normal_scale: float = 0.0,
    features: Float[Tensor, "V k"] | None = None,
    face_features: Float[Tensor, "F j"] | None = None,
    detach_weights: bool = False,
) -> SurfaceMeasure:
    """The continuous measure of a shape: uniform by area (or length), with normals or features as further coordinates.

    A point of the shape becomes position ‖ ``normal_scale`` · unit normal ‖ features in R^d, where features of the
    vertices are interpolated linearly and normals and features of the faces are constant on each face. Differentiable
    in the vertices, weights included, and in the features.

    Parameters
    ----------
    shape : Mesh or Contour
    normal_scale : float
        The length given to a unit normal, in units of the vertices; see :func:`meshot.varifold`. At zero, the default,
        there are no such coordinates.
    features : tensor, optional
        A row for each vertex (colour, thickness), in units that make a difference of one as bad as a distance of one.
    face_features : tensor, optional
        A row for each face (or edge of a contour).
    detach_weights : bool
        Stop the gradient through the areas, so that only the places of the corners carry it.

    Raises
    ------
    ValueError
        If ``normal_scale`` is negative, features do not fit the shape, or the shape has no area.

    Notes
    -----
    Without coordinates that are constant on faces, faces share their corners. With them every face has its own: d is
    larger, and there are three corners for each triangle.

    References
    ----------
    Le et al., ICLR 2024, Section 3.1, calls this the (hierarchical) continuous probability measure of a mesh.
    """
    if not normal_scale >= 0:
        raise ValueError(f"normal_scale is {normal_scale!r}; a number >= 0 in units of the vertices is needed")
    is_contour = isinstance(shape, Contour)
    cells = shape.edges if is_contour else shape.faces
    weights = normalised(edge_lengths(shape) if is_contour else face_areas(shape))
    linear = [shape.vertices]
    if features is not None:
        linear.append(_fitting(features, "features", shape.vertices, len(shape.vertices), "vertex"))
    constant = [normal_scale * (edge_normals(shape) if is_contour else face_normals(shape))] if normal_scale > 0 else []
    if face_features is not None:
        constant.append(_fitting(face_features, "face_features", shape.vertices, len(cells), "face or edge"))
    vertices = torch.cat(linear, dim=1)
    if constant:
        corners = cells.shape[1]
        own = torch.cat(constant, dim=1).repeat_interleave(corners, dim=0)
        position, interpolated = vertices[cells.flatten()].tensor_split([linear[0].shape[1]], dim=1)
        width = constant[0].shape[1] if normal_scale > 0 else 0
        vertices = torch.cat([position, own[:, :width], interpolated, own[:, width:]], dim=1)
        cells = torch.arange(len(vertices), device=vertices.device).view(-1, corners)
    return SurfaceMeasure(vertices, cells, weights.detach() if detach_weights else weights)


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
