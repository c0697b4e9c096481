"""Smooth random fields and random diffeomorphisms, which give the variation between subjects."""

import dataclasses
import math

import numpy as np
import torch

from meshot.flow import integrate
from meshot.flow.fields import GridVelocity, grid_around, spline_values
from meshot.mesh import Mesh
from meshot.rng import Generator, numpy_generator
from meshot.types import Float, Tensor

COARSEST = 48.0  # mm between the nodes of the coarsest grid; each further grid has half the spacing
STEEPEST = 12.0  # largest allowed Lipschitz bound, which limits the number of steps
#: Standard deviation in space of a cubic spline whose coefficients are independent with standard deviation 1:
#: the mean of the sum of squared weights along one axis is 151/315.
SPREAD = (151 / 315) ** 1.5
MARGIN = 16.0
LARGEST = 2.5  # standard deviations
VARIATION_MM = 30.0  # length scale of the variation of folding depth and cortical thickness over the surface


def random_velocity(*points: Float[Tensor, "_ 3"], warp_mm: tuple[float, ...], generator: Generator) -> GridVelocity:
    """A smooth random velocity field around the points, constant in time. Its flow is a random diffeomorphism.

    Parameters
    ----------
    points : tensor
    warp_mm : tuple
        Standard deviation of the velocity along each axis, in mm per unit of time, on grids with nodes 48, 24, 12, …
        mm apart.
    generator : generator or int

    Raises
    ------
    ValueError
        If there is no scale, or a standard deviation is negative.
    """
    if not warp_mm or not all(math.isfinite(size) and size >= 0 for size in warp_mm):
        raise ValueError(f"warp_mm is {warp_mm}; one number >= 0 for each scale is needed, coarse to fine, in mm")
    rng = numpy_generator(generator)
    spacings = tuple(COARSEST / 2**level for level in range(len(warp_mm)))
    field = grid_around(*points, margin=MARGIN, spacings=spacings, n_pieces=1).requires_grad_(False)
    for level, size in zip(field.levels, warp_mm, strict=True):
        level.copy_(torch.from_numpy(rng.standard_normal(tuple(level.shape))) * (size / SPREAD))
    return field


@dataclasses.dataclass(frozen=True, eq=False)
class HeadWarp:
    """The deformation of a whole head: other sizes along the axes, then the flow of a velocity.

    Parameters
    ----------
    sizes : tensor
        Factors along x, y and z.
    field : GridVelocity, optional
        None for no flow.
    n_steps : int
        Number of Runge–Kutta steps of the flow.
    """

    sizes: Float[Tensor, " 3"]
    field: GridVelocity | None
    n_steps: int = 1

    def forward(self, points: Float[Tensor, "n 3"]) -> Float[Tensor, "n 3"]:
        """Positions in the deformed head of points of the template head, in mm."""
        points = points * self.sizes
        return points if self.field is None else integrate(self.field, points, self.n_steps, "rk4").detach()

    def of_meshes(self, meshes: list[Mesh]) -> list[Mesh]:
        """The meshes after the deformation. All their vertices are integrated together."""
        moved = self.forward(torch.cat([mesh.vertices for mesh in meshes]))
        parts = moved.split([len(mesh.vertices) for mesh in meshes])
        return [mesh.with_vertices(part) for mesh, part in zip(meshes, parts, strict=True)]

    def backward(self, points: Float[Tensor, "n 3"]) -> Float[Tensor, "n 3"]:
        """Positions in the template head of points of the deformed head, in mm."""
        if self.field is not None:
            points = integrate(self.field, points, self.n_steps, "rk4", inverse=True).detach()
        return points / self.sizes


def random_warp(meshes: list[Mesh], size_sd: float, warp_mm: tuple[float, ...], generator: Generator) -> HeadWarp:
    """A random deformation of a head that contains the meshes.

    The steps of the flow (Runge–Kutta of order four) are short enough that each is injective: h·L ≤ ½ for the bound L
    of the Lipschitz constant, and a step reduces no distance by more than the factor 2 − e^(h·L) > 0. Triangles between
    moving vertices may intersect where surfaces nearly touch.

    Parameters
    ----------
    meshes : list of Mesh
        In the space of the template.
    size_sd : float
        Standard deviation of the logarithm of the sizes: see :func:`meshot.synth.warp.random_sizes`.
    warp_mm : tuple
        See :func:`meshot.synth.warp.random_velocity`. Empty for no flow.
    generator : generator or int

    Raises
    ------
    ValueError
        If the Lipschitz bound of the velocity is above 12.
    """
    rng = numpy_generator(generator)
    sizes = random_sizes(size_sd, rng)
    if not warp_mm:
        return HeadWarp(sizes, None)
    return HeadWarp(sizes, *_injective_flow([mesh.vertices * sizes for mesh in meshes], warp_mm, rng))


def _injective_flow(
    points: list[Float[Tensor, "_ 3"]], warp_mm: tuple[float, ...], generator: Generator
) -> tuple[GridVelocity, int]:
    """A random velocity around the points, and the number of steps with which its flow is injective."""
    field = random_velocity(*points, warp_mm=warp_mm, generator=generator)
    steepness = float(field.lipschitz_bound())
    if steepness > STEEPEST:
        raise ValueError(
            f"warp_mm = {warp_mm} gives a velocity with Lipschitz bound {steepness:.3g}; at most {STEEPEST:g} is "
            "allowed: make the warp weaker, first at its finest scale"
        )
    return field, max(1, math.ceil(2 * steepness))


def smooth_variation(
    points: Float[Tensor, "n 3"], length: float, generator: Generator, n_fields: int = 1
) -> Float[Tensor, "n k"]:
    """Smooth random fields at the points, each with mean 0 and standard deviation 1 in space, clipped to ± 2.5.

    Parameters
    ----------
    points : tensor
        In mm.
    length : float
        Length scale of the fields in mm: the distance between the nodes of a cubic spline.
    generator : generator or int
    n_fields : int
        Number of independent fields, at most 3.

    Raises
    ------
    ValueError
        If ``length`` is not positive, or ``n_fields`` is not 1, 2 or 3.
    """
    if not length > 0 or n_fields not in (1, 2, 3):
        raise ValueError(f"length is {length!r} and n_fields {n_fields!r}; a length > 0 and 1, 2 or 3 are needed")
    rng = numpy_generator(generator)
    lower = torch.floor(points.amin(dim=0) / length) - 1
    n_nodes = [int(n) for n in torch.ceil(points.amax(dim=0) / length) - lower + 3]
    coefficients = torch.from_numpy(rng.standard_normal((*n_nodes, 3))).to(points) / SPREAD
    values = spline_values(coefficients, points / length - lower)[:, :n_fields]
    return values.clamp(-LARGEST, LARGEST)


def random_sizes(size_sd: float, generator: Generator) -> Float[Tensor, " 3"]:
    """Random factors along x, y and z whose logarithms have standard deviation ``size_sd``."""
    return torch.from_numpy(np.exp(size_sd * numpy_generator(generator).standard_normal(3)))
