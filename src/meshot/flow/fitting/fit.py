"""Fitting a flow: the field whose flow carries one mesh to where a loss is least."""

import copy
import dataclasses
import itertools
import os
from collections.abc import Callable

import numpy as np
import torch

from meshot.flow.fields.field import LearnedVelocity
from meshot.flow.fitting.backtracking import backtrack, carried, passes, require_no_crossings
from meshot.flow.fitting.checkpoint import HISTORY, FitState, read_state, write_state
from meshot.flow.fitting.settings import FitSettings, Guard
from meshot.loss import quasi_directions, sliced_wasserstein
from meshot.measure import DiscreteMeasure
from meshot.mesh import Mesh
from meshot.types import Tensor

FitLoss = Callable[[Mesh, int, np.random.Generator], Tensor]
Encoding = Callable[[Mesh], DiscreteMeasure]
Watch = Callable[[Mesh], dict[str, float]]


@dataclasses.dataclass(frozen=True, eq=False)
class Fit:
    """A fitted flow: the best field, the mesh it makes, and how it came about.

    ``history`` holds ``iteration``, ``loss`` and ``n_directions`` for every iteration; ``checked_iteration`` and
    ``checked_loss`` (always the same directions) for every check; with a guard, ``checked_crossings`` (faces) for every
    check and ``retreat_iteration`` for every time the fit backed off; and what else was watched, for every check.
    ``best_iteration`` is the check the field is from, and ``n_steps`` how many steps carried the mesh there.
    """

    field: LearnedVelocity
    mesh: Mesh
    history: dict[str, list[float]]
    best_iteration: int
    n_steps: int


def fit_flow(
    field: LearnedVelocity,
    mesh: Mesh,
    loss: FitLoss,
    settings: FitSettings | None = None,
    checkpoint: str | os.PathLike | None = None,
    progress: Callable[[int, float], None] | None = None,
    guard: Guard | None = None,
    watch: Watch | None = None,
) -> Fit:
    """Fit a velocity field so that the flow carries ``mesh`` to where ``loss`` is least.

    Adam with a learning rate that falls along half a cosine. Vertices move, faces stay. The field given is left as it
    is; a fitted copy is returned, in the best state of all checks.

    Parameters
    ----------
    field : LearnedVelocity
        Where to start from, such as :func:`meshot.flow.fields.grid_around` or a network.
    mesh : Mesh
    loss : callable of (mesh, n_directions, generator)
        Any differentiable loss of the carried mesh on any encoding; :func:`meshot.flow.fitting.sliced_loss` makes one.
        Losses without directions ignore the last two.
    settings : FitSettings, optional
    checkpoint : path, optional
        A safetensors file, written whole every ``save_every`` iterations. If it is there already, the fit goes on from
        it and ends with the same field as if it had never stopped.
    progress : callable of (iterations done, loss), optional
        Called after every iteration; :func:`meshot.flow.fitting.progress.fit_progress` makes one that draws a bar.
    guard : Guard, optional
        Count the faces that cross at every check, and back off when there are any.
    watch : callable of (mesh), optional
        Measures the carried mesh at every check: names and numbers, such as distances, which go into the history and
        change nothing else.

    Raises
    ------
    ValueError
        If the checkpoint belongs to other settings or another field, there is a guard and faces cross from the start,
        or what is watched has the name of something that the history holds anyway.
    FloatingPointError
        If the loss or a gradient is not finite; it names the iteration. The checkpoint then holds the last good state.

    Notes
    -----
    On one thread a fit repeats bit for bit. On several, torch may add the gradients of shared corners in another order
    each time; after ``torch.use_deterministic_algorithms(True)`` it repeats there too.
    """
    settings = settings or FitSettings()
    field = copy.deepcopy(field)
    state = FitState(field, torch.optim.Adam(field.parameters(), lr=settings.learning_rate), settings.n_steps)
    kept = dataclasses.asdict(settings) | {"guard": None if guard is None else dataclasses.asdict(guard)}
    if checkpoint is not None and os.path.exists(checkpoint):
        read_state(checkpoint, state, kept)
    elif guard is not None:
        require_no_crossings(carried(state, mesh, settings), guard)
    while not _is_done(state, settings, guard):
        value = _iterate(state, mesh, loss, settings)
        if state.iteration % settings.check_every == 0 or state.iteration == settings.n_iterations:
            _check(state, mesh, loss, settings, guard, watch)
        if checkpoint is not None and (_is_done(state, settings, guard) or state.iteration % settings.save_every == 0):
            write_state(checkpoint, state, kept)
        if progress is not None:
            progress(state.iteration, value)
    state.restore_best()
    with torch.no_grad():
        result = carried(state, mesh, settings)
    return Fit(field, result, state.history, state.best_iteration, state.n_steps)


def sliced_loss(target: Mesh, encoding: Encoding, p: float = 2) -> FitLoss:
    """The sliced Wasserstein loss to ``target`` along fresh directions, for :func:`meshot.flow.fitting.fit_flow`.

    Parameters
    ----------
    target : Mesh
    encoding : callable of a mesh
        Such as ``lambda mesh: varifold(mesh, normal_scale=8.0)``.
    p : float
    """
    encoded = encoding(target)

    def loss(mesh: Mesh, n_directions: int, generator: np.random.Generator) -> Tensor:
        seed = int(generator.integers(2**31))
        directions = quasi_directions(n_directions, encoded.points.shape[1], seed).to(encoded.points)
        return sliced_wasserstein(encoding(mesh), encoded, directions, p)

    return loss


def _is_done(state: FitState, settings: FitSettings, guard: Guard | None) -> bool:
    fruitless = sum(i > state.best_iteration for i in state.history["checked_iteration"])
    given_up = guard is not None and len(state.history["retreat_iteration"]) >= guard.max_retreats
    out_of_patience = settings.patience is not None and fruitless >= settings.patience
    return state.iteration >= settings.n_iterations or given_up or out_of_patience


def _iterate(state: FitState, mesh: Mesh, loss: FitLoss, settings: FitSettings) -> float:
    i = state.iteration
    n_directions, generator = settings.n_directions_at(i), np.random.default_rng([settings.seed, i])
    state.optimiser.zero_grad(set_to_none=True)
    value = loss(carried(state, mesh, settings), n_directions, generator)
    _require_finite_step(value.detach(), f"the loss of iteration {i}")
    value.backward()
    for name, parameter in state.field.named_parameters():
        if parameter.grad is not None:
            _require_finite_step(parameter.grad, f"the gradient in {name} of iteration {i}")
    stages = state.field.stages()
    for parameter in itertools.chain(*stages[settings.n_stages_at(i, len(stages)) :]):
        parameter.grad = None  # Adam leaves it where it is
    for group in state.optimiser.param_groups:
        group["lr"] = settings.learning_rate_at(i) * state.rate_factor
    state.optimiser.step()
    state.iteration = i + 1
    for key, entry in (("iteration", i), ("loss", float(value.detach())), ("n_directions", n_directions)):
        state.history[key].append(entry)
    return float(value.detach())


def _require_finite_step(values: Tensor, name: str) -> None:
    if not bool(torch.isfinite(values.sum())):
        raise FloatingPointError(
            f"{name} is not finite; lower the learning rate, take more steps, or look for degenerate faces"
        )


def _check(
    state: FitState, mesh: Mesh, loss: FitLoss, settings: FitSettings, guard: Guard | None, watch: Watch | None
) -> None:
    generator = np.random.default_rng([settings.seed, settings.n_iterations])
    with torch.no_grad():
        moved = carried(state, mesh, settings)
        value = float(loss(moved, settings.n_directions[1], generator))
    state.history["checked_iteration"].append(state.iteration)
    state.history["checked_loss"].append(value)
    for name, number in ({} if watch is None else watch(moved)).items():
        if name in HISTORY:
            raise ValueError(
                f"what is watched is called {name!r}, which the history holds anyway; give it another name"
            )
        state.history.setdefault(name, []).append(float(number))
    if guard is not None and not passes(state, moved, guard):
        backtrack(state, mesh, settings, guard)
    elif value < state.best_loss:
        state.keep_as_best(value)
