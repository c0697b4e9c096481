"""Backing off in places: where a flow makes faces cross it is brought to a stand, and everywhere else it goes on."""

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
    """The field brought to a stand around some places, at all times: on its finest grid, of one level.

    Coefficients up to ``radius`` from a place become zero, and from there to twice as far they rise to what they were,
    so that the field stays as smooth as its splines are.

    Parameters
    ----------
    field : GridVelocity
    places : tensor
    radius : float
        In mm. The velocity is zero at a place if this is more than 3.5 times the finest spacing (cubic splines), and
        small if it is less.

    Raises
    ------
    ValueError
        If the places are not a finite, floating-point matrix with three columns, or the radius is not positive.
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
    """The field brought to a stand wherever it would make faces of the mesh cross, in as many rounds as that takes.

    A round carries the mesh, finds the faces that cross at the end, and stills the field along their paths, one
    ``radius`` farther in every third round. Coefficients up to that distance from a path become zero, and from there to
    twice as far they rise to what they were. The flow stays one of a smooth field, and is untouched elsewhere: what is
    lost is closeness at those faces. Compare :class:`meshot.flow.fitting.Guard`, which makes the whole fit back off.

    Parameters
    ----------
    field : GridVelocity
    mesh : Mesh
        Without crossing faces.
    n_steps, method
        As in :func:`meshot.integrate`.
    radius : float
        In mm. The velocity is zero at a place if this is more than 3.5 times the finest spacing (cubic splines), and
        small if it is less.
    max_rounds : int

    Returns
    -------
    GridVelocity
        The field itself if no faces cross.

    Raises
    ------
    ValueError
        If faces of the mesh cross before it is carried, or still do after so many rounds, or if
        the radius is not positive.
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
