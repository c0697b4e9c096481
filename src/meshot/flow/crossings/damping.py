"""Local damping of a velocity field: set it to zero near the faces that its flow makes intersect."""

import itertools

import torch
from scipy.spatial import cKDTree

from meshot.errors import as_floating, require_positive_integer, require_shape
from meshot.flow.fields.grid import GridVelocity, single_level
from meshot.flow.integration import trajectory
from meshot.mesh import Mesh
from meshot.mesh.topology import self_intersecting_faces
from meshot.types import Float, Tensor


@torch.no_grad()
def damped(field: GridVelocity, places: Float[Tensor, "n 3"], radius: float) -> GridVelocity:
    """A copy of the field that is zero near the given positions at all times, as one level on the finest grid.

    Coefficients at most ``radius`` from a position become zero. Between ``radius`` and twice ``radius`` they are scaled
    by a factor that rises linearly from 0 to 1. The result is a spline, so the field stays as smooth as before.

    Parameters
    ----------
    field : GridVelocity
    places : tensor
        The positions, in mm.
    radius : float
        In mm. With cubic splines, the velocity at a position is exactly zero if ``radius`` is more than 3.5 times the
        finest spacing, and small otherwise.

    Raises
    ------
    ValueError
        If the positions are not a finite, floating-point matrix with three columns, or ``radius`` is not positive.
    """
    places = as_floating(places, "places")
    require_shape(places, "places", 3)
    if not radius > 0:
        raise ValueError(f"radius is {radius!r}; a positive number of mm is needed")
    coefficients, spacing = field.coefficients(), field.spacings[-1]
    axes = [
        first + spacing * torch.arange(-1, n - 1, dtype=torch.float64)
        for first, n in zip(field.lower.tolist(), coefficients.shape[1:4], strict=True)
    ]
    nodes = torch.stack(torch.meshgrid(*axes, indexing="ij"), dim=-1)
    distances = cKDTree(places.cpu().numpy()).query(nodes.flatten(0, 2).numpy(), distance_upper_bound=2 * radius)[0]
    share = (torch.from_numpy(distances).view(nodes.shape[:3]) / radius - 1).clamp(0, 1).to(coefficients)
    return single_level(coefficients * share[None, ..., None], field.lower, spacing, field.interpolation)


def without_crossings(
    field: GridVelocity, mesh: Mesh, n_steps: int = 12, method: str = "euler", radius: float = 3.0, max_rounds: int = 20
) -> GridVelocity:
    """The field, damped near every face of the mesh that its flow makes intersect another face.

    Each round moves the mesh, finds the faces that intersect at the end, and damps the field along the paths of their
    vertices. The radius grows by ``radius`` after every third round. The
    field does not change elsewhere, and its flow remains that of a smooth field. Near the damped faces the mesh is
    less close to the target. :class:`meshot.flow.fitting.Guard` instead changes the fit as a whole.

    Parameters
    ----------
    field : GridVelocity
    mesh : Mesh
        Without self-intersections.
    n_steps, method
        As in :func:`meshot.integrate`.
    radius : float
        In mm. With cubic splines, the velocity at a position is exactly zero if ``radius`` is more than 3.5 times the
        finest spacing, and small otherwise.
    max_rounds : int
        Maximum number of rounds.

    Returns
    -------
    GridVelocity
        The field itself if no faces intersect.

    Raises
    ------
    ValueError
        If the mesh has self-intersections before it is moved or after ``max_rounds`` rounds, or ``radius`` is not
        positive.
    """
    require_positive_integer(max_rounds, "max_rounds")
    if len(self_intersecting_faces(mesh)):
        raise ValueError("faces of the mesh cross before it is carried: a standstill cannot mend that; mend the mesh")
    places, calmed = mesh.vertices[:0], field
    for round_ in itertools.count():
        with torch.no_grad():
            positions = trajectory(calmed, mesh.vertices, n_steps, method)
        crossing = self_intersecting_faces(mesh.with_vertices(positions[-1]))
        if not len(crossing):
            return calmed
        if round_ == max_rounds:
            raise ValueError(f"{len(crossing)} faces still cross after {max_rounds} rounds: enlarge the radius")
        corners = torch.unique(mesh.faces[crossing])
        places = torch.cat([places, positions[:, corners].flatten(0, 1)])
        calmed = damped(field, places, radius * (1 + round_ // 3))
