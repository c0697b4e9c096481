"""Discrete probability measures, and the two encodings of a mesh that end in one."""

import dataclasses

import torch

from meshot.errors import as_floating, require_shape
from meshot.mesh.geometry import (
    edge_lengths,
    edge_midpoints,
    edge_normals,
    face_areas,
    face_barycentres,
    face_normals,
)
from meshot.mesh.mesh import Contour, Mesh
from meshot.mesh.sampling import sample_points
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
        The masses aᵢ, each at least zero, that sum to one; equal masses if left out.

    Raises
    ------
    ValueError
        If an array is empty, has another shape or dtype, or holds NaN; if a weight is negative or the weights do not
        sum to one.
    """

    points: Float[Tensor, "n d"]
    weights: Float[Tensor, " n"] | None = None

    def __post_init__(self):
        points = as_floating(self.points, "points")
        require_shape(points, "points", None)
        weights = points.new_full((len(points),), 1 / len(points)) if self.weights is None else self.weights
        weights = as_floating(weights, "weights")
        require_probabilities(weights, points, len(points))
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "weights", weights)

    def __repr__(self) -> str:
        n, d = self.points.shape
        return f"DiscreteMeasure({n} points in R^{d}, {self.points.dtype})"


def require_probabilities(weights: Tensor, points: Tensor, n_items: int) -> None:
    """Require ``n_items`` masses, each at least zero, that sum to one, of the dtype and on the device of the points.

    Raises
    ------
    ValueError
        If one of these does not hold.
    """
    if weights.shape != (n_items,):
        raise ValueError(
            f"weights has shape {tuple(weights.shape)}; ({n_items},) is needed, one for each point or cell"
        )
    if weights.dtype != points.dtype or weights.device != points.device:
        raise ValueError(
            f"weights is {weights.dtype} on {weights.device}, points {points.dtype} on {points.device}: convert one"
        )
    if float(weights.detach().min()) < 0:
        raise ValueError(f"weights has a negative entry ({float(weights.detach().min()):.3g}); masses must be >= 0")
    total = float(weights.detach().double().sum())
    if abs(total - 1) > 1e-4 if weights.dtype == torch.float32 else abs(total - 1) > 1e-8:
        raise ValueError(f"weights sum to {total:.9g}; a probability measure needs 1: divide by weights.sum()")


def normalised(sizes: Float[Tensor, " n"]) -> Float[Tensor, " n"]:
    """Areas or lengths divided by their total.

    Raises
    ------
    ValueError
        If the total is zero: a shape without area carries no measure.
    """
    total = sizes.sum()
    if not float(total.detach()) > 0:
        raise ValueError(
            f"the total area or length is {float(total.detach()):.3g}; a measure needs a shape of positive size"
        )
    return sizes / total


def empirical(shape: Mesh | Contour, n_points: int, generator: Generator) -> DiscreteMeasure:
    """The empirical measure of an i.i.d. sample: ``n_points`` equal masses, drawn uniformly by area (or length).

    The points are differentiable in the vertices at fixed draws, which leaves out how the face probabilities change
    with the vertices: the gradient of an expectation over samples is therefore biased wherever areas change.

    Parameters
    ----------
    shape : Mesh or Contour
    n_points : int
        The number m of supports.
    generator : numpy.random.Generator, torch.Generator or int
        Who holds the randomness; an integer is a seed.

    Raises
    ------
    ValueError
        If ``n_points`` < 1, or the shape has no area.

    References
    ----------
    Le et al., *Diffeomorphic Mesh Deformation via Efficient Optimal Transport*, ICLR 2024, Section 3.1.
    """
    return DiscreteMeasure(sample_points(shape, n_points, generator))


def varifold(shape: Mesh | Contour, normal_scale: float = 1.0, detach_weights: bool = False) -> DiscreteMeasure:
    """The oriented varifold: barycentre ‖ ``normal_scale`` · unit normal, weighted by relative area (or length).

    Parameters
    ----------
    shape : Mesh or Contour
        A mesh gives supports in R⁶, a contour in R⁴.
    normal_scale : float
        The length given to a unit normal, in units of the vertices: with vertices in mm and a scale of 10, turning a
        face around costs as much as moving it by 20 mm. Zero keeps the constant coordinates; they change no distance.
    detach_weights : bool
        Stop the gradient through the areas, so that only barycentres and normals carry it.

    Raises
    ------
    ValueError
        If ``normal_scale`` is negative, or the shape has no area.

    References
    ----------
    Le et al., ICLR 2024, Section 3.1; Kaltenmark, Charlier and Charon, CVPR 2017.
    """
    if not normal_scale >= 0:
        raise ValueError(f"normal_scale is {normal_scale!r}; a number >= 0 in units of the vertices is needed")
    if isinstance(shape, Contour):
        places, normals, sizes = edge_midpoints(shape), edge_normals(shape), edge_lengths(shape)
    else:
        places, normals, sizes = face_barycentres(shape), face_normals(shape), face_areas(shape)
    weights = normalised(sizes)
    points = torch.cat([places, normal_scale * normals], dim=1)
    return DiscreteMeasure(points, weights.detach() if detach_weights else weights)
