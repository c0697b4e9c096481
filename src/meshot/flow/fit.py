"""Fitting a flow: the field whose flow carries one mesh to where a loss is least."""

import copy
import dataclasses
import math
import os
from collections.abc import Callable

import numpy as np
import torch

from meshot.errors import require_positive_integer
from meshot.flow.checkpoint import FitState, read_state, write_state
from meshot.flow.field import VelocityField
from meshot.flow.integrate import integrate
from meshot.loss.directions import quasi_directions
from meshot.loss.sliced import sliced_wasserstein
from meshot.measure.discrete import DiscreteMeasure
from meshot.mesh.mesh import Mesh
from meshot.types import Tensor

FitLoss = Callable[[Mesh, int, np.random.Generator], Tensor]
Encoding = Callable[[Mesh], DiscreteMeasure]


@dataclasses.dataclass(frozen=True, eq=False)
class FitSettings:
    """How a flow is fitted.

    Parameters
    ----------
    n_iterations : int
        Of Adam.
    learning_rate : float
        At the start, in mm per unit of time: about how far a coefficient moves in one iteration. It falls to zero
        along half a cosine.
    n_steps, method
        As in :func:`meshot.integrate`.
    n_directions : pair of int
        How many directions the loss is given at the start and at the end; the number doubles in equal stretches.
    check_every : int
        The fit is judged by the loss with the most directions, always the same, every so many iterations.
    save_every : int
        Iterations between checkpoints, if a file for them is given.
    seed : int
        Of everything random; iteration i draws from (seed, i), so that a resumed fit draws what it would have drawn.

    Raises
    ------
    ValueError
        If a count is not a positive integer, the directions decrease, or the learning rate is not positive.
    """

    n_iterations: int = 1000
    learning_rate: float = 0.3
    n_steps: int = 12
    method: str = "euler"
    n_directions: tuple[int, int] = (16, 64)
    check_every: int = 25
    save_every: int = 100
    seed: int = 0

    def __post_init__(self):
        for name in ("n_iterations", "n_steps", "check_every", "save_every"):
            require_positive_integer(getattr(self, name), name)
        for count in self.n_directions:
            require_positive_integer(count, "n_directions")
        if not 0 < self.learning_rate < math.inf:
            raise ValueError(f"learning_rate is {self.learning_rate!r}; a finite number > 0 is needed, in mm")
        if len(self.n_directions) != 2 or self.n_directions[0] > self.n_directions[1]:
            raise ValueError(f"n_directions is {self.n_directions}; two counts that do not decrease are needed")

    def learning_rate_at(self, iteration: int) -> float:
        """Half a cosine from ``learning_rate`` to zero."""
        return self.learning_rate * 0.5 * (1 + math.cos(math.pi * iteration / self.n_iterations))

    def n_directions_at(self, iteration: int) -> int:
        """First · 2^k, in equal stretches, up to the last."""
        first, last = self.n_directions
        n_stretches = math.ceil(math.log2(last / first)) + 1
        return min(last, first * 2 ** (iteration * n_stretches // self.n_iterations))


@dataclasses.dataclass(frozen=True, eq=False)
class Fit:
    """A fitted flow: the best field, the mesh it makes, and how it came about.

    ``history`` holds ``iteration``, ``loss`` and ``n_directions`` for every iteration, ``checked_iteration`` and
    ``checked_loss`` (always the same directions) for every check; ``best_iteration`` is the check the field is from.
    """

    field: VelocityField
    mesh: Mesh
    history: dict[str, list[float]]
    best_iteration: int


def fit_flow(
    field: VelocityField,
    mesh: Mesh,
    loss: FitLoss,
    settings: FitSettings | None = None,
    checkpoint: str | os.PathLike | None = None,
    report: Callable[[int, float], None] | None = None,
) -> Fit:
    """Fit a velocity field so that the flow carries ``mesh`` to where ``loss`` is least.

    Adam with a learning rate that falls along half a cosine. Vertices move, faces stay. The field given is left as it
    is; a fitted copy is returned, in the best state of all checks.

    Parameters
    ----------
    field : VelocityField
        Where to start from, such as :func:`meshot.flow.grid.grid_around`.
    mesh : Mesh
    loss : callable of (mesh, n_directions, generator)
        Any differentiable loss of the carried mesh on any encoding; :func:`meshot.flow.fit.sliced_loss` makes one.
        Losses without directions ignore the last two.
    settings : FitSettings, optional
    checkpoint : path, optional
        A safetensors file, written whole every ``save_every`` iterations. If it is there already, the fit goes on from
        it and ends with the same field as if it had never stopped.
    report : callable of (iterations done, loss), optional
        Called after every iteration, for a progress bar.

    Raises
    ------
    ValueError
        If the checkpoint belongs to other settings or another field.
    FloatingPointError
        If the loss or a gradient is not finite; it names the iteration. The checkpoint then holds the last good state.

    Notes
    -----
    On one thread a fit repeats bit for bit. On several, torch may add the gradients of shared corners in another order
    each time; after ``torch.use_deterministic_algorithms(True)`` it repeats there too.
    """
    settings = settings or FitSettings()
    field = copy.deepcopy(field)
    optimiser = torch.optim.Adam(field.parameters(), lr=settings.learning_rate)
    state = FitState(field, optimiser)
    if checkpoint is not None and os.path.exists(checkpoint):
        read_state(checkpoint, state, dataclasses.asdict(settings))
    while state.iteration < settings.n_iterations:
        value = _iterate(state, mesh, loss, settings)
        if state.iteration % settings.check_every == 0 or state.iteration == settings.n_iterations:
            _check(state, mesh, loss, settings)
        done = state.iteration == settings.n_iterations
        if checkpoint is not None and (done or state.iteration % settings.save_every == 0):
            write_state(checkpoint, state, dataclasses.asdict(settings))
        if report is not None:
            report(state.iteration, value)
    state.restore_best()
    with torch.no_grad():
        carried = _carried(field, mesh, settings)
    return Fit(field, carried, state.history, state.best_iteration)


def sliced_loss(target: Mesh, encoding: Encoding, p: float = 2) -> FitLoss:
    """The sliced Wasserstein loss to ``target`` along fresh directions, for :func:`meshot.flow.fit.fit_flow`.

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


def _carried(field: VelocityField, mesh: Mesh, settings: FitSettings) -> Mesh:
    return mesh.with_vertices(integrate(field, mesh.vertices, settings.n_steps, settings.method))


def _iterate(state: FitState, mesh: Mesh, loss: FitLoss, settings: FitSettings) -> float:
    i = state.iteration
    n_directions, generator = settings.n_directions_at(i), np.random.default_rng([settings.seed, i])
    state.optimiser.zero_grad(set_to_none=True)
    value = loss(_carried(state.field, mesh, settings), n_directions, generator)
    _require_finite_step(value.detach(), f"the loss of iteration {i}")
    value.backward()
    for name, parameter in state.field.named_parameters():
        if parameter.grad is not None:
            _require_finite_step(parameter.grad, f"the gradient in {name} of iteration {i}")
    for group in state.optimiser.param_groups:
        group["lr"] = settings.learning_rate_at(i)
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


@torch.no_grad()
def _check(state: FitState, mesh: Mesh, loss: FitLoss, settings: FitSettings) -> None:
    generator = np.random.default_rng([settings.seed, settings.n_iterations])
    value = float(loss(_carried(state.field, mesh, settings), settings.n_directions[1], generator))
    state.history["checked_iteration"].append(state.iteration)
    state.history["checked_loss"].append(value)
    if value < state.best_loss:
        state.keep_as_best(value)
