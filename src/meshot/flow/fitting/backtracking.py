"""Backtracking of a fit after self-intersections: restore the best state, reduce the learning rate, add steps."""

import torch

from meshot.flow.crossings.guard import inspect_paths
from meshot.flow.fitting.settings import FitSettings, Guard
from meshot.flow.fitting.state import FitState
from meshot.flow.integration import integrate
from meshot.mesh import Mesh
from meshot.mesh.topology import self_intersecting_faces


def carried(state: FitState, mesh: Mesh, settings: FitSettings) -> Mesh:
    """The mesh moved by the flow of the current field."""
    moved = integrate(state.network, mesh.vertices, state.n_steps, settings.method, gradient=settings.gradient)
    return mesh.with_vertices(moved)


def require_no_crossings(mesh: Mesh, guard: Guard) -> None:
    """Check that the mesh at the start of a fit has no more self-intersections than the guard allows.

    Raises
    ------
    ValueError
        If it has more: there would be no valid state to return to.
    """
    n_crossings = len(self_intersecting_faces(mesh))
    if n_crossings > guard.max_crossings:
        raise ValueError(
            f"{n_crossings} faces cross before the fit begins, {guard.max_crossings} are allowed: there is no state to "
            "go back to; mend the mesh, or allow as many in the guard"
        )


@torch.no_grad()
def backtrack(state: FitState, mesh: Mesh, settings: FitSettings, guard: Guard) -> None:
    """Restore the best valid state, reduce the learning rate and reset the momentum.

    If the step size is too large, the number of steps is doubled until h·Lip < 1 along the paths of the current field.
    The old number is kept if the best state would have self-intersections with more steps.
    """
    paths = inspect_paths(state.network, mesh.vertices, state.n_steps, settings.method)
    wanted = state.n_steps
    # Doubling keeps every step inside one time interval of the field.
    while ((paths.n_flips and wanted == state.n_steps) or wanted <= paths.steepest) and 2 * wanted <= guard.max_steps:
        wanted *= 2
    state.restore_best()
    before = state.n_steps
    state.n_steps = max(wanted, before)
    if len(self_intersecting_faces(carried(state, mesh, settings))) > guard.max_crossings:
        state.n_steps = before
    state.rate_factor *= guard.slow_down
    state.optimiser.state.clear()
