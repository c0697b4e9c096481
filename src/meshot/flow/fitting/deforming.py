"""A fit in one call: one mesh carried to another, at any size and in any unit."""

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
# All in units of half the longest side of the box that holds both meshes. A sphere of 40 mm and its folds made them:
# grids of 24, 12, 6 and 3 mm, 12 mm around it, a learning rate of .3 mm, and normals of 8 mm.
_N_LEVELS, _MARGIN, _LEARNING_RATE, _NORMAL_SCALE = 4, 0.3, 0.0075, 0.2


@dataclasses.dataclass(frozen=True, eq=False)
class Deformation:
    """A mesh carried to another, and the flow that carries it.

    Parameters
    ----------
    mesh : Mesh
        The source where the flow takes it: its faces, other vertices.
    flow : GridVelocity
        The velocity, in the units of the mesh per unit of time.
    n_steps : int
        How many Euler steps carried the mesh.
    losses : tuple of float
        The loss at every check of the fit, over that of the source: 1 where nothing is gained.

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
        """Other points carried along: from the space of the source to that of the target, or back.

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
    """The source carried to the target by a smooth flow that a loss is least for: a fit in one call.

    A velocity on nested grids is fitted by Adam: :func:`meshot.flow.fitting.fit_flow`, with lengths in proportion to
    the meshes. Scaling or shifting both changes nothing but the unit of the result, up to rounding. Where no check of
    the fit has a lower loss than the source, the source stays as it is and the flow is at rest.

    Parameters
    ----------
    source, target : Mesh
        Roughly aligned; any numbers of vertices and faces, without correspondence.
    loss : callable of (mesh, mesh), optional
        Any differentiable loss between the carried mesh and the target, such as :func:`meshot.chamfer`, in the units of
        the meshes. If left out, it is sliced Wasserstein between varifolds along fresh directions, with unit normals a
        fifth as long as half the longest side of the box that holds both meshes.
    n_iterations : int
        Of Adam.
    detail : float
        The spacing of the finest grid, in units of half the longest side of the box that holds both meshes: half of it
        follows finer folds, at eight times the memory.
    allow_crossings : bool
        Otherwise the fit backs off wherever faces of the carried mesh cross: see :class:`meshot.flow.fitting.Guard`.
    seed : int
        Of the directions.
    progress : bool
        Draw a bar on standard error.

    Raises
    ------
    ValueError
        If an argument is no mesh, the two differ in dtype or device, a number is outside its range, faces of the source
        cross and may not, or the loss is no finite number with a gradient.

    References
    ----------
    Le et al., *Diffeomorphic Mesh Deformation via Efficient Optimal Transport*, ICLR 2024, Algorithm 1, fitted to one
    pair.

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
    """The fitted velocity, or the one at rest if the loss of the start is not above that of the best check."""
    generator = np.random.default_rng([settings.seed, settings.n_iterations])  # the directions of the checks
    with torch.no_grad():
        unmoved = float(relative(start, settings.n_directions[1], generator))
    checked = dict(zip(fit.history["checked_iteration"], fit.history["checked_loss"], strict=True))
    best = checked.get(fit.best_iteration, math.inf)  # no check is best where all of them were given up
    return fit.field if best < unmoved else rest


def _require_mesh(value: object, name: str) -> None:
    if not isinstance(value, Mesh):
        raise ValueError(
            f"{name} is a {type(value).__qualname__}; a meshot.Mesh is needed: Mesh(vertices, faces), "
            "Mesh.from_trimesh(...), Mesh.from_pyvista(...) or read_mesh(path)"
        )


def _frame(source: Mesh, target: Mesh) -> tuple[Float[Tensor, " 3"], float]:
    """The centre of the box that holds both meshes, and half its longest side."""
    everything = torch.cat([source.vertices.detach(), target.vertices.detach()])
    low, high = everything.amin(dim=0), everything.amax(dim=0)
    size = float((high - low).max()) / 2
    if not size > 0:
        raise ValueError("source and target are one point; meshes with an extent are needed")
    return (low + high) / 2, size


def _relative_loss(
    loss: MeshLoss | None, source: Mesh, target: Mesh, centre: Tensor, size: float, settings: FitSettings
) -> FitLoss:
    """The loss of a mesh in the frame of the fit, over that of the source, so that no number of it has a unit."""
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
