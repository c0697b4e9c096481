"""Fitting a flow: the field whose flow carries one mesh to where a loss is least."""

import copy
import dataclasses
import itertools
import os
from collections.abc import Callable

import numpy as np
import torch

from meshot.flow.fields.field import LearnedVelocity
from meshot.flow.fitting.backtracking import backtrack, carried, require_no_crossings
from meshot.flow.fitting.settings import FitSettings, Guard
from meshot.flow.fitting.state import FitState
from meshot.loss import quasi_directions, sliced_wasserstein
from meshot.measure import DiscreteMeasure
from meshot.mesh import Mesh
from meshot.mesh.topology import self_intersecting_faces
from meshot.train import Task, train
from meshot.types import Tensor

FitLoss = Callable[[Mesh, int, np.random.Generator], Tensor]
Encoding = Callable[[Mesh], DiscreteMeasure]
Watch = Callable[[Mesh], dict[str, float]]

#: What the history of a fit holds, whatever is watched.
HISTORY = (
    "iteration", "loss", "n_directions", "checked_iteration", "checked_loss", "checked_crossings", "retreat_iteration",
)  # fmt: skip


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
        Called after every iteration; :func:`meshot.flow.fitting.fit_progress` makes one that draws a bar.
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
    state = FitState(field, settings.learning_rate, settings.n_steps)
    if guard is not None and not (checkpoint is not None and os.path.exists(checkpoint)):
        require_no_crossings(carried(state, mesh, settings), guard)
    made_with = dataclasses.asdict(settings) | {"guard": None if guard is None else dataclasses.asdict(guard)}

    def tell(done: int, n_iterations: int, line: dict) -> None:
        if progress is not None and "loss" in line:
            progress(done, line["loss"])

    train(state, settings.plan(), _task(state, mesh, loss, settings, guard, watch), made_with, checkpoint, None, tell)
    with torch.no_grad():
        result = carried(state, mesh, settings)
    return Fit(field, result, _history(state.lines, settings), state.best_step, state.n_steps)


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


def _task(
    state: FitState, mesh: Mesh, loss: FitLoss, settings: FitSettings, guard: Guard | None, watch: Watch | None
) -> Task:
    stages = state.network.stages()

    def loss_of(i: int) -> tuple[Tensor, str]:
        generator = np.random.default_rng([settings.seed, i])
        return loss(carried(state, mesh, settings), settings.n_directions_at(i), generator), "of the fit"

    def hold_fine_stages(i: int) -> None:
        for parameter in itertools.chain(*stages[settings.n_stages_at(i, len(stages)) :]):
            parameter.grad = None  # Adam leaves it where it is

    def is_given_up() -> bool:
        return guard is not None and sum(line.get("retreated", False) for line in state.lines) >= guard.max_retreats

    return Task(loss_of, lambda _: _checked(state, mesh, loss, settings, guard, watch), hold_fine_stages, is_given_up)


def _checked(
    state: FitState, mesh: Mesh, loss: FitLoss, settings: FitSettings, guard: Guard | None, watch: Watch | None
) -> dict:
    """The line of a check; with a guard, the fit backs off if too many faces cross."""
    generator = np.random.default_rng([settings.seed, settings.n_iterations])
    with torch.no_grad():
        moved = carried(state, mesh, settings)
        value = float(loss(moved, settings.n_directions[1], generator))
    watched = {} if watch is None else {name: float(number) for name, number in watch(moved).items()}
    for name in watched.keys() & set(HISTORY):
        raise ValueError(f"what is watched is called {name!r}, which the history holds anyway; give it another name")
    found = {"validation_loss": value, "checked_loss": value, "watched": watched}
    if guard is not None:
        n_crossings = len(self_intersecting_faces(moved))
        found |= {"checked_crossings": n_crossings, "retreated": n_crossings > guard.max_crossings}
        if found["retreated"]:
            backtrack(state, mesh, settings, guard)
            found["validation_loss"] = None
    return found


def _history(lines: list[dict], settings: FitSettings) -> dict[str, list[float]]:
    """The lines of a log as columns."""
    history: dict[str, list[float]] = {name: [] for name in HISTORY}
    for line in lines:
        if "loss" in line:
            i = line["step"] - 1
            new = {"iteration": i, "loss": line["loss"], "n_directions": settings.n_directions_at(i)}
        else:
            new = {"checked_iteration": line["step"], "checked_loss": line["checked_loss"]} | line["watched"]
            new |= {name: line[name] for name in ("checked_crossings",) if name in line}
            new |= {"retreat_iteration": line["step"]} if line.get("retreated") else {}
        for name, value in new.items():
            history.setdefault(name, []).append(value)
    return history
