"""Deformation of one mesh into another in one call, for meshes of any size and in any unit."""

import dataclasses
import functools
import math
from collections.abc import Callable

import numpy as np
import torch

from meshot.errors import require_same_space
from meshot.flow.fields.grid import GridVelocity, grid_around
from meshot.flow.fitting.fit import Fit, FitLoss, fit_flow, sliced_loss
from meshot.flow.fitting.progress import fit_progress
from meshot.flow.fitting.settings import FitSettings, Guard
from meshot.flow.integration import integrate
from meshot.measure import varifold
from meshot.mesh import Mesh
from meshot.types import Float, Tensor

MeshLoss = Callable[[Mesh, Mesh], Tensor]
# All in units of half the longest side of the box that contains both meshes. The values were chosen for folded spheres
# of radius 40 mm: grids of 24, 12, 6 and 3 mm, a margin of 12 mm, a learning rate of .3 mm, and normals of 8 mm.
_N_LEVELS, _MARGIN, _LEARNING_RATE, _NORMAL_SCALE = 4, 0.3, 0.0075, 0.2


@dataclasses.dataclass(frozen=True, eq=False)
class Deformation:
    """A deformed mesh, and the flow that deforms it.

    Parameters
    ----------
    mesh : Mesh
        The source after the flow: the same faces, other vertices.
    flow : GridVelocity
        The velocity field, in the units of the mesh per unit of time.
    n_steps : int
        Number of Euler steps.
    losses : tuple of float
        The loss at every check of the fit, divided by the loss of the source.

    Examples
    --------
    >>> import meshot
    >>> from meshot.mesh.shapes import cube, icosphere
    >>> result = meshot.deform(icosphere(1), icosphere(1, 1.2), n_iterations=2, detail=0.3, progress=False)
    >>> result.carry(cube(0.1).vertices).shape
    torch.Size([8, 3])
    """

    mesh: Mesh
    flow: GridVelocity
    n_steps: int
    losses: tuple[float, ...]

    def carry(self, points: Float[Tensor, "n 3"], inverse: bool = False) -> Float[Tensor, "n 3"]:
        """Move other points by the flow, from the space of the source to that of the target, or back.

        Parameters
        ----------
        points : tensor
        inverse : bool
            Whether to move points from the space of the target to that of the source.

        Raises
        ------
        ValueError
            As :func:`meshot.integrate`.
        """
        return integrate(self.flow, points, self.n_steps, inverse=inverse)


def deform(
    source: Mesh,
    target: Mesh,
    loss: MeshLoss | None = None,
    *,
    n_iterations: int = 300,
    detail: float = 0.075,
    allow_crossings: bool = False,
    seed: int = 0,
    progress: bool = True,
) -> Deformation:
    """Deform the source into the target by a smooth flow that minimises a loss.

    A velocity field on nested grids is fitted with Adam by :func:`meshot.flow.fitting.fit_flow`. All lengths are
    relative to the size of the meshes: if both meshes are scaled or shifted, the result is scaled or shifted with them,
    up to rounding. If no check has a lower loss than the source, the result is the source with a zero velocity.

    Parameters
    ----------
    source, target : Mesh
        Roughly aligned. They may have any numbers of vertices and faces, and need no correspondence.
    loss : callable of (mesh, mesh), optional
        A differentiable loss between the deformed mesh and the target, such as :func:`meshot.chamfer`, in the units of
        the meshes. The default is the sliced Wasserstein loss between varifolds, with new directions in every
        iteration, and with unit normals scaled to a fifth of half the longest side of the box that contains both
        meshes.
    n_iterations : int
        Number of iterations of Adam.
    detail : float
        Spacing of the finest grid, in units of half the longest side of the box that contains both meshes. Half the
        value resolves finer folds and needs eight times the memory.
    allow_crossings : bool
        If false, the fit backtracks whenever the deformed mesh intersects itself, see
        :class:`meshot.flow.fitting.Guard`.
    seed : int
        Seed of the directions.
    progress : bool
        Whether to show a progress bar on standard error.

    Raises
    ------
    ValueError
        If an argument is not a mesh, the meshes differ in dtype or device, a number is outside its range, the source
        intersects itself although ``allow_crossings`` is false, or the loss is not a finite number with a gradient.

    References
    ----------
    Le et al., *Diffeomorphic Mesh Deformation via Efficient Optimal Transport*, ICLR 2024, Algorithm 1, here applied
    to one pair of meshes.

    Examples
    --------
    >>> import meshot
    >>> from meshot.mesh.shapes import folded_sphere, icosphere
    >>> start, target = icosphere(1, 1.0), folded_sphere(1, radius=1.0, depth=0.2)
    >>> result = meshot.deform(start, target, n_iterations=10, detail=0.3, progress=False)
    >>> result.mesh
    Mesh(42 vertices, 80 faces, torch.float64)
    >>> result.losses[-1] < 1
    True
    """
    for name, value in (("source", source), ("target", target)):
        _require_mesh(value, name)
    require_same_space(source.vertices, target.vertices)
    if not 0 < detail < 1:
        raise ValueError(f"detail is {detail!r}; a share in (0, 1) is needed, of half the longest side of the box")
    centre, size = _frame(source, target)
    settings = FitSettings(n_iterations, _LEARNING_RATE, check_every=min(25, n_iterations), seed=seed)
    start, goal = (mesh.with_vertices((mesh.vertices.detach() - centre) / size) for mesh in (source, target))
    relative = _relative_loss(loss, source, target, centre, size, settings)
    spacings = tuple(detail * 2**k for k in reversed(range(_N_LEVELS)))
    field = grid_around(start.vertices, goal.vertices, margin=_MARGIN, spacings=spacings)
    guard = None if allow_crossings else Guard()
    with fit_progress(settings, "deform", disable=not progress) as report:
        fit = fit_flow(field, start, relative, settings, progress=report, guard=guard)
    flow = _least(field, fit, relative, start, settings).scaled(size, centre)
    mesh = source.with_vertices(integrate(flow, source.vertices, fit.n_steps).detach())
    return Deformation(mesh, flow, fit.n_steps, tuple(fit.history["checked_loss"]))


def _least(rest: GridVelocity, fit: Fit, relative: FitLoss, start: Mesh, settings: FitSettings) -> GridVelocity:
    """The fitted velocity, or the zero velocity if the best check is not below the loss of the undeformed source."""
    generator = np.random.default_rng([settings.seed, settings.n_iterations])  # the directions of the checks
    with torch.no_grad():
        unmoved = float(relative(start, settings.n_directions[1], generator))
    checked = dict(zip(fit.history["checked_iteration"], fit.history["checked_loss"], strict=True))
    best = checked.get(fit.best_iteration, math.inf)  # absent if every check was rejected
    return fit.field if best < unmoved else rest


def _require_mesh(value: object, name: str) -> None:
    if not isinstance(value, Mesh):
        raise ValueError(
            f"{name} is a {type(value).__qualname__}; a meshot.Mesh is needed: Mesh(vertices, faces), "
            "Mesh.from_trimesh(...), Mesh.from_pyvista(...) or read_mesh(path)"
        )


def _frame(source: Mesh, target: Mesh) -> tuple[Float[Tensor, " 3"], float]:
    """The centre of the bounding box of both meshes, and half its longest side."""
    everything = torch.cat([source.vertices.detach(), target.vertices.detach()])
    low, high = everything.amin(dim=0), everything.amax(dim=0)
    size = float((high - low).max()) / 2
    if not size > 0:
        raise ValueError("source and target are one point; meshes with an extent are needed")
    return (low + high) / 2, size


def _relative_loss(
    loss: MeshLoss | None, source: Mesh, target: Mesh, centre: Tensor, size: float, settings: FitSettings
) -> FitLoss:
    """The loss of a mesh in normalised coordinates, divided by the loss of the source, so that it has no unit."""
    if loss is None:
        in_full = sliced_loss(target, functools.partial(varifold, normal_scale=_NORMAL_SCALE * size))
    else:

        def in_full(mesh: Mesh, n_directions: int, generator: np.random.Generator) -> Tensor:
            return loss(mesh, target)

    moving = source.with_vertices(source.vertices.detach().clone().requires_grad_())
    first = in_full(moving, settings.n_directions[1], np.random.default_rng(settings.seed))
    if not isinstance(first, Tensor) or first.numel() != 1 or not first.requires_grad:
        raise ValueError(f"the loss returned {first!r}; one number with a gradient in the vertices is needed")
    unit = abs(float(first.detach()))
    if not unit < math.inf:
        raise ValueError(f"the loss of the source is {unit}; a finite number is needed")

    def relative(mesh: Mesh, n_directions: int, generator: np.random.Generator) -> Tensor:
        there = mesh.with_vertices(mesh.vertices * size + centre)
        return in_full(there, n_directions, generator) / (unit or 1.0)

    return relative
