"""Discrete probability measures, and the two encodings of a mesh that end in one."""

import dataclasses

import torch

from meshot.errors import as_floating, require_shape
from meshot.measure.coordinates import Extras, cell_shares, cells_of
from meshot.measure.probabilities import as_probabilities
from meshot.mesh import Contour, Mesh, sample_locations
from meshot.rng import Generator
from meshot.types import Float, Tensor


@dataclasses.dataclass(frozen=True, eq=False)
class DiscreteMeasure:
    """Finitely many weighted points: Σᵢ aᵢ δ(xᵢ), validated at the door.

    Parameters
    ----------
    points : tensor or array
        The supports xᵢ, one row each.
    weights : tensor or array, optional
        The masses aᵢ, each at least zero, that sum to one; equal masses if left out. They are given the dtype of the
        points, and are divided by their sum if it is within 1e-5 of one.

    Raises
    ------
    ValueError
        If an array is empty, has another shape or dtype, or holds NaN; if a weight is negative or the weights do not
        sum to one.

    Examples
    --------
    >>> import torch, meshot
    >>> meshot.DiscreteMeasure(torch.zeros(4, 3), torch.tensor([0.1, 0.2, 0.3, 0.4]))
    DiscreteMeasure(4 points in R^3, torch.float32)
    """

    points: Float[Tensor, "n d"]
    weights: Float[Tensor, " n"] | None = None

    def __post_init__(self):
        points = as_floating(self.points, "points")
        require_shape(points, "points", None)
        weights = points.new_full((len(points),), 1 / len(points)) if self.weights is None else self.weights
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "weights", as_probabilities(weights, points, len(points)))

    @property
    def places(self) -> Float[Tensor, "n d"]:
        """The points, under the name that every :class:`meshot.measure.Measure` has for them."""
        return self.points

    @property
    def cells(self) -> None:
        """None: the mass sits on the points."""
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

    The points are differentiable in the vertices at fixed draws. Alone this leaves out how the face probabilities
    change with the vertices: wherever areas change, the gradient of an expectation over samples is biased, however many
    points are drawn. By default the masses carry the missing part.

    Parameters
    ----------
    shape : Mesh or Contour
    n_points : int
        The number m of supports.
    generator : numpy.random.Generator, torch.Generator or int
        Who holds the randomness; an integer is a seed.
    normal_scale : float
        The length given to the unit normal of the face that a point was drawn from, in units of the vertices: an
        oriented sample. At zero, the default of every encoding, there are no such coordinates.
    features, face_features, feature_scale
        As :func:`meshot.surface`: interpolated where a point was drawn.
    detach_weights : bool
        Stop the gradient through the areas, so that only the points carry it, as the paper and most codes have it. By
        default, as in every encoding, it goes through them too: each mass stays 1/m in value, and changes as the
        probability of the face that its point was drawn from (relative to the others drawn), so that the gradient of
        an expectation is right up to O(1/m).

    Raises
    ------
    ValueError
        If ``n_points`` < 1, a scale is negative, features do not fit, or the shape has no area.

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
        With normals a mesh gives supports in R⁶, a contour in R⁴; without, in R³ and R². Features are further
        coordinates.
    normal_scale : float
        The length given to a unit normal, in units of the vertices: with vertices in mm and a scale of 10, turning a
        face around costs as much as moving it by 20 mm. At zero, the default of every encoding, there are no such
        coordinates, since no length suits a mesh in mm and one of unit size alike: what is left are the barycentres,
        weighted by area. The paper's varifold has 1.
    features, face_features, feature_scale
        As :func:`meshot.surface`; features of the vertices are averaged over the corners of the face.
    detach_weights : bool
        Stop the gradient through the areas, so that only barycentres and normals carry it. By default, as in every
        encoding, it goes through them too and is that of the whole measure.

    Raises
    ------
    ValueError
        If a scale is negative, features do not fit, or the shape has no area.

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
    """So many supports of the oriented varifold, whatever the size of the mesh: faces drawn by area, of equal mass.

    An i.i.d. sample of :func:`meshot.varifold`; a large face may be drawn twice. What follows costs time and memory by
    ``n_points``, not by the faces.

    Parameters
    ----------
    shape : Mesh or Contour
    n_points : int
        The number of supports.
    generator : numpy.random.Generator, torch.Generator or int
        Who holds the randomness; an integer is a seed.
    normal_scale, features, face_features, feature_scale
        As :func:`meshot.varifold`.
    detach_weights : bool
        Stop the part of the gradient that goes through the areas. By default, as in every encoding, it is kept: every
        mass stays 1/n in value and changes as the area of its face does, relative to the others drawn, so that the
        gradient of an expectation is that of the whole varifold up to O(1/n).

    Raises
    ------
    ValueError
        If ``n_points`` < 1, a scale is negative, features do not fit, or the shape has no area.
    """
    Extras(shape, normal_scale, features, face_features, feature_scale)  # face_features belong to all faces
    drawn, _ = sample_locations(shape, n_points, generator)
    cells = cells_of(shape)[drawn]
    part = Contour(shape.vertices, cells) if isinstance(shape, Contour) else Mesh(shape.vertices, cells)
    of_drawn = None if face_features is None else face_features[drawn]
    whole = varifold(
        part, normal_scale=normal_scale, features=features, face_features=of_drawn, feature_scale=feature_scale
    )
    return DiscreteMeasure(whole.points, None if detach_weights else _drawn_masses(cell_shares(part)))


def _drawn_masses(shares: Float[Tensor, " n"]) -> Float[Tensor, " n"]:
    """Equal in value; in derivative, each changes with the logarithm of the probability it was drawn with."""
    changes = shares / shares.detach()
    return changes / changes.sum()
