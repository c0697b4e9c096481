"""Vertices that correspond between people.

:func:`carry_template` carries the white surface of fsaverage5 to the white surface of one person by fitted flows.
"""

import contextlib
import dataclasses

import numpy as np
import torch

from meshot.anatomy import Hemisphere, fsaverage5_surface
from meshot.flow import FitSettings, fit_flow, grid_around, sliced_loss
from meshot.loss import chamfer
from meshot.measure import empirical, varifold
from meshot.mesh import Mesh, self_intersecting_faces, simplified, smooth_crossings
from meshot.metrics import Surface, average_surface_distance, offsets_between
from meshot.types import Tensor

#: The first flow moves area over large distances, the second refines; lengths in mm.
_NORMAL_SCALE, _SPACINGS, _MARGINS = 8.7, ((24.0, 12.0, 6.0, 3.0), (12.0, 6.0, 3.0)), (12.0, 6.0)
_N_ITERATIONS, _RATES, _COARSE_SHARES = (80, 150), (0.3, 0.15), (0.4, 0.2)
_N_STEPS, _N_FACES, _N_POINTS, _N_MEASURED = 6, 40_000, 20_000, 20_000


@dataclasses.dataclass(frozen=True, eq=False)
class CarriedTemplate:
    """The surface of the template in the place of a person's surface.

    Vertex i is the same vertex of fsaverage5 in every person. The flow brings surfaces together. It knows no sulci by
    name, so the correspondence is approximate.

    Parameters
    ----------
    mesh : Mesh
        10 242 vertices, in the space of the person's surface.
    distance_mm : float
        Average symmetric distance (ASSD) to the person's surface.
    n_crossing_before : int
        Number of faces that intersected others after the flows.
    n_crossing : int
        The same after they were smoothed: 0, unless this failed.
    """

    mesh: Mesh
    distance_mm: float
    n_crossing_before: int
    n_crossing: int


def carry_template(surface: Mesh, side: Hemisphere, n_iterations: tuple[int, int] = _N_ITERATIONS) -> CarriedTemplate:
    """Carry fsaverage5's white surface to the white surface of a person by two fitted flows.

    The first flow minimises the sliced Wasserstein distance between oriented varifolds, the second the Chamfer distance
    between points drawn in every iteration. Faces that intersect afterwards are smoothed.

    Parameters
    ----------
    surface : Mesh
        In MNI152 coordinates, in mm.
    side : str
        "left" or "right".
    n_iterations : pair of int
        Number of iterations of each flow.

    Raises
    ------
    ValueError
        If the side is unknown, a number of iterations is not a positive integer, or the mean of the vertices lies
        outside the bounding box of the template.
    """
    template = fsaverage5_surface("white", side, "MNI152")
    low, high = template.vertices.amin(dim=0), template.vertices.amax(dim=0)
    middle = surface.vertices.detach().double().cpu().mean(dim=0)
    if not bool(((low < middle) & (middle < high)).all()):
        raise ValueError(
            f"the centre of the surface is at {[round(x, 1) for x in middle.tolist()]} mm, outside the box of the "
            "template; a white surface of this side in MNI152 coordinates is needed"
        )
    goal = surface.with_vertices(surface.vertices.detach().double().cpu())
    coarse = simplified(goal, _N_FACES).to(torch.float32)
    fine = goal.to(torch.float32)

    def distance(mesh: Mesh, n_directions: int, generator: np.random.Generator) -> Tensor:
        drawn = (empirical(each, _N_POINTS, generator, detach_weights=True) for each in (mesh, fine))
        return chamfer(*drawn)

    losses = (sliced_loss(coarse, lambda mesh: varifold(mesh, normal_scale=_NORMAL_SCALE)), distance)
    moved = template.to(torch.float32)
    for k, loss in enumerate(losses):
        field = grid_around(
            moved.vertices, goal.vertices.to(torch.float32), margin=_MARGINS[k], spacings=_SPACINGS[k], n_pieces=1
        )
        settings = FitSettings(
            n_iterations[k], _RATES[k], _N_STEPS, check_every=n_iterations[k], coarse_share=_COARSE_SHARES[k]
        )
        moved = fit_flow(field, moved, loss, settings).mesh
    mesh = moved.to(torch.float64)
    n_before = len(self_intersecting_faces(mesh))
    if n_before:
        with contextlib.suppress(ValueError):  # smoothing failed
            mesh = smooth_crossings(mesh)
    n_after = len(self_intersecting_faces(mesh)) if n_before else 0
    offsets = offsets_between(Surface(mesh), Surface(goal), _N_MEASURED)
    return CarriedTemplate(mesh, average_surface_distance(*offsets), n_before, n_after)
