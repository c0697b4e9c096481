"""Fitting of a velocity field whose flow moves a mesh so that a loss becomes small."""

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

#: The entries that every history of a fit has.
HISTORY = (
    "iteration", "loss", "n_directions",
    "checked_iteration", "checked_loss", "checked_crossings", "backtrack_iteration",
)  # fmt: skip


@dataclasses.dataclass(frozen=True, eq=False)
class Fit:
    """A fitted flow: the best field, the mesh moved by it, and the history of the fit.

    ``history`` holds ``iteration``, ``loss`` and ``n_directions`` for every iteration. For every check it holds
    ``checked_iteration``, ``checked_loss`` (always with the same directions), the values of ``watch``, and with a guard
    ``checked_crossings`` (number of self-intersecting faces). ``backtrack_iteration`` lists the backtracks.
    ``best_iteration`` is the iteration of the check with the best valid state. ``n_steps`` is the number of integration
    steps.
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
    """Fit a velocity field so that ``loss`` of the mesh moved by its flow becomes small.

    The optimiser is Adam, with a learning rate that decreases along half a cosine. Vertices move, faces stay the same.
    The given field is not modified. The result is a fitted copy, in the best state among all checks.

    Parameters
    ----------
    field : LearnedVelocity
        The initial field, such as :func:`meshot.flow.fields.grid_around` or a network.
    mesh : Mesh
    loss : callable of (mesh, n_directions, generator)
        Any differentiable loss of the moved mesh, in any encoding. :func:`meshot.flow.fitting.sliced_loss` makes one.
        Losses without directions ignore the last two arguments.
    settings : FitSettings, optional
    checkpoint : path, optional
        A safetensors file, written every ``save_every`` iterations. If the file exists, the fit resumes from it and
        ends with the same field as an uninterrupted fit.
    progress : callable of (iterations done, loss), optional
        Called after every iteration. :func:`meshot.flow.fitting.fit_progress` makes one that shows a progress bar.
    guard : Guard, optional
        Counts self-intersecting faces at every check, and backtracks if there are too many.
    watch : callable of (mesh), optional
        Called with the moved mesh at every check. Returns named numbers, such as distances, that are stored in the
        history. They do not influence the fit.

    Raises
    ------
    ValueError
        If the checkpoint belongs to other settings or another field, the initial mesh has more self-intersections than
        the guard allows, or a name returned by ``watch`` is an entry of every history.
    FloatingPointError
        If the loss or a gradient is not finite. The message names the iteration; the checkpoint holds the last finite
        state.

    Notes
    -----
    On one thread, a fit is reproducible bit for bit. On several threads torch may add the gradients of shared vertices
    in varying order. After ``torch.use_deterministic_algorithms(True)`` the fit is reproducible there too.
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
    """The sliced Wasserstein loss to ``target`` with new directions in every iteration, for ``fit_flow``.

    Parameters
    ----------
    target : Mesh
    encoding : callable of a mesh
        For example ``lambda mesh: varifold(mesh, normal_scale=8.0)``.
    p : float
        Exponent of the ground cost.
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
            parameter.grad = None  # Adam skips parameters without a gradient

    def is_given_up() -> bool:
        return guard is not None and sum(line.get("backtracked", False) for line in state.lines) >= guard.max_backtracks

    return Task(loss_of, lambda _: _checked(state, mesh, loss, settings, guard, watch), hold_fine_stages, is_given_up)


def _checked(
    state: FitState, mesh: Mesh, loss: FitLoss, settings: FitSettings, guard: Guard | None, watch: Watch | None
) -> dict:
    """The log entry of a check. With a guard, the fit backtracks if too many faces intersect."""
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
        found |= {"checked_crossings": n_crossings, "backtracked": n_crossings > guard.max_crossings}
        if found["backtracked"]:
            backtrack(state, mesh, settings, guard)
            found["validation_loss"] = None
    return found


def _history(lines: list[dict], settings: FitSettings) -> dict[str, list[float]]:
    """The entries of a log as columns."""
    history: dict[str, list[float]] = {name: [] for name in HISTORY}
    for line in lines:
        if "loss" in line:
            i = line["step"] - 1
            new = {"iteration": i, "loss": line["loss"], "n_directions": settings.n_directions_at(i)}
        else:
            new = {"checked_iteration": line["step"], "checked_loss": line["checked_loss"]} | line["watched"]
            new |= {name: line[name] for name in ("checked_crossings",) if name in line}
            new |= {"backtrack_iteration": line["step"]} if line.get("backtracked") else {}
        for name, value in new.items():
            history.setdefault(name, []).append(value)
    return history
