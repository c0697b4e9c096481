"""Watching a flow: how far it bends space along the paths, and which faces of a mesh cross on the way."""

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
    """What a flow does to space in the neighbourhood of the points that it carries.

    Parameters
    ----------
    positions : tensor
        Before the first step and after each.
    norms : tensor
        Spectral norm of the velocity's Jacobian at the beginning of every step, per unit of time: the local Lipschitz
        constant.
    determinants : tensor
        Of the Jacobian of every step map: by what factor a small volume grows in that step; zero or less is a flip.
    """

    positions: Float[Tensor, "k n d"]
    norms: Float[Tensor, "n_steps n"]
    determinants: Float[Tensor, "n_steps n"]

    @property
    def steepest(self) -> float:
        """The largest local Lipschitz constant met on the way, per unit of time."""
        return float(self.norms.max())

    @property
    def n_flips(self) -> int:
        """How many times a step turned the neighbourhood of a point inside out."""
        return int((self.determinants <= 0).sum())

    @property
    def volume_factors(self) -> Float[Tensor, " n"]:
        """By what factor the whole flow makes small volumes at each point grow."""
        return self.determinants.prod(dim=0)

    @property
    def step_times_lipschitz(self) -> float:
        """h·Lip along the paths; below one every Euler step is one-to-one near them."""
        return self.steepest / len(self.norms)

    @property
    def safe_steps(self) -> int:
        """The fewest equal steps with h·Lip < 1 along these paths."""
        return steps_below(self.steepest)


def steps_below(lipschitz: float, share: float = 1.0) -> int:
    """The fewest equal steps on [0, 1] with step · ``lipschitz`` < ``share``.

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
    """Local Jacobians along the paths of the points, as the method takes them. Without gradient.

    2d passes backward per step. Says nothing about places that no point goes through.

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
    """How many faces cross others of the mesh before the first step and after each, counted exactly.

    As ``self_intersecting_faces`` of ``meshot.mesh.topology.intersection``; about 1 s per step for 330 000 faces.

    Raises
    ------
    ValueError
        As :func:`meshot.integrate`.
    """
    positions = trajectory(field, mesh.vertices, n_steps, method)
    return [len(self_intersecting_faces(mesh.with_vertices(p))) for p in positions]
