"""Diagnosis of a flow: Jacobians along the paths of points, and self-intersections of a mesh after each step."""

import dataclasses
import math

import torch

from meshot.flow.crossings.jacobian import point_jacobians
from meshot.flow.fields.field import Velocity, VelocityField
from meshot.flow.integration import step_maps, trajectory
from meshot.mesh import Mesh
from meshot.mesh.topology import self_intersecting_faces
from meshot.types import Float, Tensor


@dataclasses.dataclass(frozen=True, eq=False)
class PathReport:
    """Local Jacobians of a flow along the paths of points.

    Parameters
    ----------
    positions : tensor
        Positions of the points before the first step and after each step.
    norms : tensor
        Spectral norm of the velocity's Jacobian at the start of every step: the local Lipschitz constant, per unit of
        time.
    determinants : tensor
        Determinant of the Jacobian of every step map: the factor by which the step scales a small volume. A value of
        zero or less means that the step reverses orientation there (a flip).
    """

    positions: Float[Tensor, "k n d"]
    norms: Float[Tensor, "n_steps n"]
    determinants: Float[Tensor, "n_steps n"]

    @property
    def steepest(self) -> float:
        """The largest local Lipschitz constant along the paths, per unit of time."""
        return float(self.norms.max())

    @property
    def n_flips(self) -> int:
        """The number of pairs of point and step where the step map reverses orientation."""
        return int((self.determinants <= 0).sum())

    @property
    def volume_factors(self) -> Float[Tensor, " n"]:
        """The factor by which the whole flow scales a small volume at each point."""
        return self.determinants.prod(dim=0)

    @property
    def step_times_lipschitz(self) -> float:
        """Step size times Lipschitz constant along the paths; below 1, every Euler step is injective near them."""
        return self.steepest / len(self.norms)

    @property
    def safe_steps(self) -> int:
        """The smallest number of equal steps with h·Lip < 1 along these paths."""
        return steps_below(self.steepest)


def steps_below(lipschitz: float, share: float = 1.0) -> int:
    """The smallest number of equal steps on [0, 1] for which step size · ``lipschitz`` < ``share``.

    Raises
    ------
    ValueError
        If ``lipschitz`` is negative or not finite (no step is small enough), or ``share`` is not positive.
    """
    if not 0 <= lipschitz < math.inf:
        raise ValueError(f"lipschitz is {lipschitz!r}; a finite number >= 0 is needed, or no step is small enough")
    if not share > 0:
        raise ValueError(f"share is {share!r}; a number > 0 is needed")
    return math.floor(lipschitz / share) + 1


def inspect_paths(
    field: VelocityField | Velocity, points: Float[Tensor, "n d"], n_steps: int = 12, method: str = "euler"
) -> PathReport:
    """Compute local Jacobians along the paths of the points, for the given integration method. Without gradient.

    Needs 2d backward passes per step. Says nothing about regions that no path visits.

    Raises
    ------
    ValueError
        As :func:`meshot.integrate`.
    """
    positions = trajectory(field, points, n_steps, method).detach()
    velocity = field.prepared() if isinstance(field, VelocityField) else field
    norms, determinants = [], []
    for (time, step), before in zip(step_maps(velocity, points, n_steps, method), positions):
        slopes = point_jacobians(lambda x, t=time: velocity(t, x), before)
        norms.append(torch.linalg.matrix_norm(slopes, ord=2))
        determinants.append(torch.linalg.det(point_jacobians(step, before)))
    return PathReport(positions, torch.stack(norms), torch.stack(determinants))


@torch.no_grad()
def crossings_along(field: VelocityField | Velocity, mesh: Mesh, n_steps: int = 12, method: str = "euler") -> list[int]:
    """The number of self-intersecting faces before the first step and after each step, computed exactly.

    Uses ``self_intersecting_faces`` of ``meshot.mesh.topology.intersection``: about 1 s per step for 330 000 faces.

    Raises
    ------
    ValueError
        As :func:`meshot.integrate`.
    """
    positions = trajectory(field, mesh.vertices, n_steps, method)
    return [len(self_intersecting_faces(mesh.with_vertices(p))) for p in positions]
