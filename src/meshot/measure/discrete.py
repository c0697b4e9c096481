"""Discrete probability measures, and the encodings of a mesh as such a measure."""

import dataclasses
import math
from collections.abc import Callable
from typing import Protocol, runtime_checkable

import torch

from meshot.errors import as_floating, as_points
from meshot.mesh import Contour, Mesh, edge_lengths, edge_normals, face_areas, face_normals, sample_locations
from meshot.rng import Generator
from meshot.types import Float, Int64, Tensor


@dataclasses.dataclass(frozen=True, eq=False)
class DiscreteMeasure:
    """A discrete probability measure Σᵢ aᵢ δ(xᵢ), validated when it is created.

    Parameters
    ----------
    points : tensor or array
        The support points xᵢ, one row each.
    weights : tensor or array, optional
        The masses aᵢ, non-negative with sum one; equal by default. They are converted to the dtype of the points, and
        divided by their sum if it is within 1e-5 of one.

    Raises
    ------
    ValueError
        If an array is empty, has the wrong shape or dtype, or contains NaN; if a weight is negative or the weights do
        not sum to one.

    Examples
    --------
    >>> import torch, meshot
    >>> meshot.DiscreteMeasure(torch.zeros(4, 3), torch.tensor([0.1, 0.2, 0.3, 0.4]))
    DiscreteMeasure(4 points in R^3, torch.float32)
    """

    points: Float[Tensor, "n d"]
    weights: Float[Tensor, " n"] | None = None

    def __post_init__(self):
        points = as_points(self.points, "points")
        weights = points.new_full((len(points),), 1 / len(points)) if self.weights is None else self.weights
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "weights", as_probabilities(weights, points, len(points)))

    @property
    def places(self) -> Float[Tensor, "n d"]:
        """The points. All classes that follow :class:`meshot.measure.Measure` have this attribute."""
        return self.points

    @property
    def cells(self) -> None:
        """None, because the mass is concentrated in points."""
        return None

    def to(self, *args: object, **kwargs: object) -> "DiscreteMeasure":
        """The same measure in another dtype or on another device (arguments as ``torch.Tensor.to``).

        Raises
        ------
        ValueError
            If the dtype is not floating point.
        """
        return DiscreteMeasure(self.points.to(*args, **kwargs), self.weights.to(*args, **kwargs))

    def __repr__(self) -> str:
        n, d = self.points.shape
        return f"DiscreteMeasure({n} points in R^{d}, {self.points.dtype})"


def empirical(
    shape: Mesh | Contour,
    n_points: int,
    generator: Generator,
    *,
    normal_scale: float = 0.0,
    features: Float[Tensor, "V k"] | None = None,
    face_features: Float[Tensor, "F j"] | None = None,
    feature_scale: float = 1.0,
    detach_weights: bool = False,
) -> DiscreteMeasure:
    """The empirical measure of an i.i.d. sample: ``n_points`` equal masses, drawn uniformly by area (or length).

    The points are differentiable with respect to the vertices, for fixed random numbers. This gradient alone ignores
    that the probabilities of the faces depend on the vertices. If areas change, it is biased as an estimate of the
    gradient of the expectation, for any number of points. By default the masses carry the missing part.

    Parameters
    ----------
    shape : Mesh or Contour
    n_points : int
        The number m of support points.
    generator : numpy.random.Generator, torch.Generator or int
        Random number generator; an integer is a seed.
    normal_scale : float
        The length of the scaled unit normal of the face that a point was drawn from, in units of the vertices. With 0,
        the default of every encoding, normals are not part of the coordinates.
    features, face_features, feature_scale
        As :func:`meshot.surface`, interpolated at the drawn points.
    detach_weights : bool
        Whether to stop the gradient through the areas, so that it flows only through the points. By default the
        gradient includes the areas: each mass has the value 1/m, and its derivative is that of the probability of its
        face, relative to the other drawn faces. The gradient of the expectation is then correct up to O(1/m).

    Raises
    ------
    ValueError
        If ``n_points`` < 1, a scale is negative, features do not fit, or the shape has zero area.

    References
    ----------
    Le et al., *Diffeomorphic Mesh Deformation via Efficient Optimal Transport*, ICLR 2024, Section 3.1. Mohamed et al.,
    *Monte Carlo Gradient Estimation in Machine Learning*, JMLR 2020, on the two parts of such a gradient.

    Examples
    --------
    >>> import meshot
    >>> from meshot.mesh.shapes import icosphere
    >>> meshot.empirical(icosphere(1), 1000, generator=0)
    DiscreteMeasure(1000 points in R^3, torch.float64)
    """
    extras = Extras(shape, normal_scale, features, face_features, feature_scale)
    drawn, barycentric = sample_locations(shape, n_points, generator)
    corners = cells_of(shape)[drawn]

    def interpolate(values: Tensor) -> Tensor:
        return (barycentric[:, :, None] * values[corners]).sum(dim=1)

    points = extras.at(interpolate, drawn, with_normals=normal_scale > 0)
    if detach_weights:
        return DiscreteMeasure(points)
    return DiscreteMeasure(points, _drawn_masses(cell_shares(shape)[drawn]))


def varifold(
    shape: Mesh | Contour,
    *,
    normal_scale: float = 0.0,
    features: Float[Tensor, "V k"] | None = None,
    face_features: Float[Tensor, "F j"] | None = None,
    feature_scale: float = 1.0,
    detach_weights: bool = False,
) -> DiscreteMeasure:
    """The oriented varifold: barycentre ‖ ``normal_scale`` · unit normal, weighted by relative area (or length).

    Parameters
    ----------
    shape : Mesh or Contour
        With normals, the support points are in R⁶ for a mesh and in R⁴ for a contour; without, in R³ and R². Features
        are further coordinates.
    normal_scale : float
        The length of a scaled unit normal, in units of the vertices. With vertices in mm and a scale of 10, reversing
        a face costs as much as moving it by 20 mm. With 0, the default of every encoding, normals are not part of the
        coordinates, because no single length suits meshes of every size; the measure then consists of barycentres
        weighted by area. The paper has unit normals, and does not state the unit of
        its coordinates.
    features, face_features, feature_scale
        As :func:`meshot.surface`; features of vertices are averaged over the corners of the face.
    detach_weights : bool
        Whether to stop the gradient through the areas, so that it flows only through barycentres and normals. By
        default, as in every encoding, the gradient is that of the whole measure, areas included.

    Raises
    ------
    ValueError
        If a scale is negative, features do not fit, or the shape has zero area.

    References
    ----------
    Le et al., ICLR 2024, Section 3.1; Kaltenmark, Charlier and Charon, CVPR 2017.

    Examples
    --------
    >>> import meshot
    >>> from meshot.mesh.shapes import icosphere
    >>> meshot.varifold(icosphere(1), normal_scale=0.5)
    DiscreteMeasure(80 points in R^6, torch.float64)
    >>> meshot.varifold(icosphere(1))
    DiscreteMeasure(80 points in R^3, torch.float64)
    """
    extras = Extras(shape, normal_scale, features, face_features, feature_scale)
    cells, weights = cells_of(shape), cell_shares(shape)
    every = torch.arange(len(cells), device=cells.device)
    points = extras.at(lambda values: values[cells].mean(dim=1), every, with_normals=normal_scale > 0)
    return DiscreteMeasure(points, weights.detach() if detach_weights else weights)


def varifold_sample(
    shape: Mesh | Contour,
    n_points: int,
    generator: Generator,
    *,
    normal_scale: float = 0.0,
    features: Float[Tensor, "V k"] | None = None,
    face_features: Float[Tensor, "F j"] | None = None,
    feature_scale: float = 1.0,
    detach_weights: bool = False,
) -> DiscreteMeasure:
    """A random sample of the oriented varifold: ``n_points`` faces drawn by area, with equal masses.

    This is an i.i.d. sample of :func:`meshot.varifold`; a large face may be drawn more than once. Time and memory of a
    loss then depend on ``n_points`` instead of the number of faces.

    Parameters
    ----------
    shape : Mesh or Contour
    n_points : int
        The number n of support points.
    generator : numpy.random.Generator, torch.Generator or int
        Random number generator; an integer is a seed.
    normal_scale, features, face_features, feature_scale
        As :func:`meshot.varifold`.
    detach_weights : bool
        Whether to stop the gradient through the areas. By default the gradient includes them: each mass has the value
        1/n, and its derivative is that of the area of its face, relative to the other drawn faces. The gradient of the
        expectation is then that of the whole varifold up to O(1/n).

    Raises
    ------
    ValueError
        If ``n_points`` < 1, a scale is negative, features do not fit, or the shape has zero area.
    """
    Extras(shape, normal_scale, features, face_features, feature_scale)  # validates face_features against all faces
    drawn, _ = sample_locations(shape, n_points, generator)
    cells = cells_of(shape)[drawn]
    part = Contour(shape.vertices, cells) if isinstance(shape, Contour) else Mesh(shape.vertices, cells)
    of_drawn = None if face_features is None else face_features[drawn]
    whole = varifold(
        part, normal_scale=normal_scale, features=features, face_features=of_drawn, feature_scale=feature_scale
    )
    return DiscreteMeasure(whole.points, None if detach_weights else _drawn_masses(cell_shares(part)))


def _drawn_masses(shares: Float[Tensor, " n"]) -> Float[Tensor, " n"]:
    """Equal masses whose derivatives are those of the logarithms of the drawn probabilities, with sum zero."""
    changes = shares / shares.detach()
    return changes / changes.sum()


# Additional coordinates besides the position: unit normals, features of vertices, features of faces.

Interpolation = Callable[[Tensor], Tensor]


@dataclasses.dataclass(frozen=True, eq=False)
class Extras:
    """Additional coordinates and their scales, validated against a shape."""

    # Every encoding orders its coordinates in the same way: position ‖ ``normal_scale`` · unit normal ‖
    # ``feature_scale`` · features of the vertices ‖ ``feature_scale`` · features of the faces.

    shape: Mesh | Contour
    normal_scale: float  # length of a scaled unit normal, in units of the vertices
    features: Float[Tensor, "V k"] | None  # one row per vertex
    face_features: Float[Tensor, "F j"] | None  # one row per face, or edge of a contour
    feature_scale: float  # length that corresponds to a difference of one, per unit of the feature

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
                features = as_floating(getattr(self, name), name)
                if features.ndim != 2 or len(features) != n_rows or features.shape[1] == 0:
                    raise ValueError(
                        f"{name} has shape {tuple(features.shape)}; ({n_rows}, k) is needed, one row for each {kind}"
                    )
                if features.dtype != vertices.dtype or features.device != vertices.device:
                    raise ValueError(
                        f"{name} is {features.dtype} on {features.device}, vertices {vertices.dtype} on "
                        f"{vertices.device}: convert one with .to(...)"
                    )
                object.__setattr__(self, name, features)

    def at(self, interpolate: Interpolation, cells: Int64[Tensor, " k"], with_normals: bool) -> Float[Tensor, "n d"]:
        """The coordinates of positions on known cells."""
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
    """The area of every face (or length of every edge) divided by the total: the probability of the cell."""
    sizes = edge_lengths(shape) if isinstance(shape, Contour) else face_areas(shape)
    total = sizes.sum()
    if not float(total.detach()) > 0:
        raise ValueError(
            f"the total area or length is {float(total.detach()):.3g}; a measure needs a shape of positive size"
        )
    return sizes / total


# Validation of weights: non-negative masses that sum to one.

_NEAR_ONE = 1e-5  # a sum within this of one is attributed to rounding, for example of single-precision weights
# A pairwise sum of n numbers has an error of at most log2(n) units of rounding, below 32. Weights are divided by one
# such sum and added up by another. Deviations up to twice that bound are therefore not corrected.
_ROUNDING = 64


def as_probabilities(weights: object, points: Tensor, n_items: int) -> Float[Tensor, " n"]:
    """The weights as ``n_items`` masses that sum to one, in the dtype of the points.

    Weights of another floating-point dtype are converted. If the sum is within 1e-5 of one, but not one up to rounding,
    the weights are divided by it. In the gradient that sum is a constant.

    Parameters
    ----------
    weights : tensor or array
        Non-negative.
    points : tensor
        Determines the dtype of the weights, and the device on which they must be.
    n_items : int
        The required number of weights.

    Raises
    ------
    ValueError
        If the shape or the device does not fit, a weight is negative or not finite, or they do not sum to one.
    """
    weights = as_floating(weights, "weights")
    if weights.shape != (n_items,):
        raise ValueError(
            f"weights has shape {tuple(weights.shape)}; ({n_items},) is needed, one for each point or cell"
        )
    if weights.device != points.device:
        raise ValueError(f"weights is on {weights.device}, points on {points.device}: move one with .to(...)")
    if float(weights.detach().min()) < 0:
        raise ValueError(f"weights has a negative entry ({float(weights.detach().min()):.3g}); masses must be >= 0")
    weights = weights.to(points.dtype)
    total, rounding = float(weights.detach().double().sum()), _ROUNDING * torch.finfo(weights.dtype).eps
    if abs(total - 1) > max(_NEAR_ONE, rounding):
        raise ValueError(f"weights sum to {total:.9g}; a probability measure needs 1: divide by weights.sum()")
    return weights if abs(total - 1) <= rounding else weights / total


# The interface between measures and losses.


@runtime_checkable
class Measure(Protocol):
    """A probability measure as the losses use it: weighted points, or mass distributed over triangles or segments.

    :class:`meshot.DiscreteMeasure` and :class:`meshot.SurfaceMeasure` follow this protocol. Every loss that accepts
    them accepts any other class with these three attributes. Such a class is not validated.
    """

    @property
    def places(self) -> Float[Tensor, "n d"]:
        """The positions that are projected, in units of the vertices: support points, or corners of the cells."""
        ...

    @property
    def weights(self) -> Float[Tensor, " k"]:
        """The masses of the cells, or of the points if there are no cells. Non-negative, with sum one."""
        ...

    @property
    def cells(self) -> Int64[Tensor, "k corners"] | None:
        """The indices of the corners of each triangle (three) or segment (two); None for a measure of points."""
        ...
