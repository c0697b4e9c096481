"""How a fit backs off when faces cross: to the best state that passed, more slowly, with more steps if those fail."""

import torch

from meshot.flow.crossings.guard import inspect_paths
from meshot.flow.fitting.settings import FitSettings, Guard
from meshot.flow.fitting.state import FitState
from meshot.flow.integration import integrate
from meshot.mesh import Mesh
from meshot.mesh.topology import self_intersecting_faces


def carried(state: FitState, mesh: Mesh, settings: FitSettings) -> Mesh:
    """The mesh where the field takes it now."""
    moved = integrate(state.network, mesh.vertices, state.n_steps, settings.method, gradient=settings.gradient)
    return mesh.with_vertices(moved)


def require_no_crossings(mesh: Mesh, guard: Guard) -> None:
    """Require that a fit starts from a state it may come back to.

    Raises
    ------
    ValueError
        If more faces cross than the guard allows.
    """
    n_crossings = len(self_intersecting_faces(mesh))
    if n_crossings > guard.max_crossings:
        raise ValueError(
            f"{n_crossings} faces cross before the fit begins, {guard.max_crossings} are allowed: there is no state to "
            "go back to; mend the mesh, or allow as many in the guard"
        )


@torch.no_grad()
def backtrack(state: FitState, mesh: Mesh, settings: FitSettings, guard: Guard) -> None:
    """Back to the best state that passed, with a smaller learning rate and without momentum.

    Where the steps are at fault, their number is doubled until h·Lip < 1 along the paths that crossed, unless the best
    state itself would not pass with so many.
    """
    paths = inspect_paths(state.network, mesh.vertices, state.n_steps, settings.method)
    wanted = state.n_steps
    # Doubling keeps steps from straddling pieces of time.
    while ((paths.n_flips and wanted == state.n_steps) or wanted <= paths.steepest) and 2 * wanted <= guard.max_steps:
        wanted *= 2
    state.restore_best()
    before = state.n_steps
    state.n_steps = max(wanted, before)
    if len(self_intersecting_faces(carried(state, mesh, settings))) > guard.max_crossings:
        state.n_steps = before
    state.rate_factor *= guard.slow_down
    state.optimiser.state.clear()
