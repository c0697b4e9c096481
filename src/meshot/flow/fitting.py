"""Minimisation of a loss over the velocity field of a flow, or over the positions of free points.

:func:`fit_flow` fits a field with Adam, with checkpoints and exact resumption. :func:`descend` moves free points by
gradient descent. Other functions integrate and diagnose sequences of fitted flows.
"""

import contextlib
import copy
import dataclasses
import functools
import itertools
import math
import os
import warnings
from collections.abc import Callable, Iterator

import numpy as np
import torch
from tqdm import tqdm

from meshot.errors import require_choice, require_positive, require_positive_integer, require_same_space
from meshot.flow.crossings import inspect_paths
from meshot.flow.fields import GridVelocity, LearnedVelocity, grid_around
from meshot.flow.integration import GRADIENTS, METHODS, integrate
from meshot.loss import sliced_wasserstein
from meshot.measure import DiscreteMeasure, varifold
from meshot.mesh import Mesh, edge_splits, self_intersecting_faces, topology, with_edges_split
from meshot.metrics import Surface, average_surface_distance, offsets_between
from meshot.train import Plan, Task, TrainingState, train
from meshot.types import Float, Tensor

# Settings of a fit, and of its backtracking.


@dataclasses.dataclass(frozen=True, eq=False)
class FitSettings:
    """Settings of a fit.

    Parameters
    ----------
    n_iterations : int
        Number of iterations of Adam.
    learning_rate : float
        Initial learning rate, in mm per unit of time: about how far a coefficient moves in one iteration. It decreases
        to zero along half a cosine.
    n_steps, method, gradient
        As in :func:`meshot.integrate`.
    n_directions : pair of int
        Number of directions of the loss at the start and at the end. It doubles after equal numbers of iterations.
    check_every : int
        Iterations between checks. A check evaluates the loss with the largest number of directions, always the same
        ones.
    save_every : int
        Iterations between checkpoints, if a checkpoint file is given.
    seed : int
        Seed of all random numbers. Iteration i uses (seed, i), so that a resumed fit draws the same numbers.
    patience : int, optional
        Stop after this many consecutive checks without a better loss.
    coarse_share : float
        Fraction of the iterations during which the levels of a field are released one after another, from coarse to
        fine. With 0 all levels move from the start.

    Raises
    ------
    ValueError
        If a count is not a positive integer, the directions decrease, the learning rate is not positive, a name is
        unknown, or ``coarse_share`` is outside [0, 1].
    """

    n_iterations: int = 1000
    learning_rate: float = 0.3
    n_steps: int = 12
    method: str = "euler"
    n_directions: tuple[int, int] = (16, 64)
    check_every: int = 25
    save_every: int = 100
    seed: int = 0
    gradient: str = "direct"
    patience: int | None = None
    coarse_share: float = 0.0

    def __post_init__(self):
        counts = ("n_iterations", "n_steps", "check_every", "save_every")
        for name in counts if self.patience is None else (*counts, "patience"):
            object.__setattr__(self, name, require_positive_integer(getattr(self, name), name))
        lines = tuple(require_positive_integer(count, "n_directions") for count in self.n_directions)
        object.__setattr__(self, "n_directions", lines)
        require_positive(self.learning_rate, "learning_rate", "mm")
        if len(self.n_directions) != 2 or self.n_directions[0] > self.n_directions[1]:
            raise ValueError(f"n_directions is {self.n_directions}; two counts that do not decrease are needed")
        require_choice(self.method, "method", METHODS)
        require_choice(self.gradient, "gradient", GRADIENTS)
        if not 0 <= self.coarse_share <= 1:
            raise ValueError(f"coarse_share is {self.coarse_share!r}; a share in [0, 1] is needed")

    def plan(self) -> Plan:
        """The settings in the form that the training loop takes."""
        return Plan(self.n_iterations, self.check_every, self.save_every, self.patience, self.learning_rate, "cosine")

    def n_directions_at(self, iteration: int) -> int:
        """The number of directions at an iteration: first · 2ᵏ up to the last, k growing at equal distances."""
        first, last = self.n_directions
        n_stretches = math.ceil(math.log2(last / first)) + 1
        return min(last, first * 2 ** (iteration * n_stretches // self.n_iterations))

    def n_stages_at(self, iteration: int, n_stages: int) -> int:
        """The number of released stages, out of ``n_stages``: one more after each equal part of ``coarse_share``."""
        until = self.coarse_share * self.n_iterations
        return n_stages if iteration >= until else 1 + int(iteration * n_stages / until)


@dataclasses.dataclass(frozen=True, eq=False)
class Guard:
    """Settings of backtracking when a fit causes self-intersections.

    At every check the self-intersecting faces are counted exactly. If there are more than ``max_crossings``, the fit
    restores the best valid state, multiplies its learning rate by ``slow_down``, and resets its momentum. If the step
    size is too large (h·Lip >= 1, or a step reverses orientation, along the paths of the vertices), the number of steps
    is also increased, as the local Jacobians require. After ``max_backtracks`` backtracks the fit stops and keeps the
    best state.

    Parameters
    ----------
    max_crossings : int
        Number of self-intersecting faces that are allowed in the moved mesh.
    slow_down : float
        Factor on the learning rate, in (0, 1).
    max_backtracks : int
        Maximum number of backtracks.
    max_steps : int
        Maximum number of integration steps.
    """

    max_crossings: int = 0
    slow_down: float = 0.5
    max_backtracks: int = 8
    max_steps: int = 64

    def __post_init__(self):
        for name in ("max_backtracks", "max_steps"):
            object.__setattr__(self, name, require_positive_integer(getattr(self, name), name))
        if self.max_crossings < 0:
            raise ValueError(f"max_crossings is {self.max_crossings!r}; a count >= 0 is needed")
        if not 0 < self.slow_down < 1:
            raise ValueError(f"slow_down is {self.slow_down!r}; a factor in (0, 1) is needed")


# The state of a fit: that of a training, plus the number of integration steps, which a guard may change.


class FitState(TrainingState):
    """The state of a fit: the field, its optimiser, the progress, and the best field so far."""

    def __init__(self, field: LearnedVelocity, learning_rate: float, n_steps: int):
        super().__init__(field, learning_rate, extras={"n_steps": n_steps})

    @property
    def n_steps(self) -> int:
        """Number of integration steps."""
        return self.extras["n_steps"]

    @n_steps.setter
    def n_steps(self, value: int) -> None:
        """Set the number of integration steps."""
        self.extras["n_steps"] = value


# A progress bar for fits.


@contextlib.contextmanager
def fit_progress(
    settings: FitSettings, description: str = "fit", disable: bool = False
) -> Iterator[Callable[[int, float], None]]:
    """Yield a ``progress`` callback for :func:`meshot.flow.fit_flow`.

    It shows a bar with the loss on standard error, unless ``disable`` is true.
    """
    with tqdm(total=settings.n_iterations, desc=description, disable=disable) as bar:

        def report(done: int, loss: float) -> None:
            bar.update(done - bar.n)
            bar.set_postfix(loss=f"{loss:.4g}")

        yield report


# Backtracking of a fit after self-intersections: restore the best state, reduce the learning rate, add steps.


def carried(state: FitState, mesh: Mesh, settings: FitSettings) -> Mesh:
    """The mesh moved by the flow of the current field."""
    moved = integrate(state.network, mesh.vertices, state.n_steps, settings.method, gradient=settings.gradient)
    return mesh.with_vertices(moved)


@torch.no_grad()
def backtrack(state: FitState, mesh: Mesh, settings: FitSettings, guard: Guard) -> None:
    """Restore the best valid state, reduce the learning rate and reset the momentum."""
    # If the step size is too large, the number of steps is doubled until h·Lip < 1 along the paths of the current
    # field. The old number is kept if the best state would have self-intersections with more steps.
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


# Fitting of a velocity field whose flow moves a mesh so that a loss becomes small.

FitLoss = Callable[[Mesh, int, np.random.Generator], Tensor]
Encoding = Callable[[Mesh], DiscreteMeasure]
Watch = Callable[[Mesh], dict[str, float]]

#: The entries that every history of a fit has.
HISTORY = ("iteration", "loss", "n_directions")
HISTORY += ("checked_iteration", "checked_loss", "checked_crossings", "backtrack_iteration")


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
        The initial field, such as :func:`meshot.flow.grid_around` or a network.
    mesh : Mesh
    loss : callable of (mesh, n_directions, generator)
        Any differentiable loss of the moved mesh, in any encoding. :func:`meshot.flow.sliced_loss` makes one.
        Losses without directions ignore the last two arguments.
    settings : FitSettings, optional
    checkpoint : path, optional
        A safetensors file, written every ``save_every`` iterations. If the file exists, the fit resumes from it and
        ends with the same field as an uninterrupted fit.
    progress : callable of (iterations done, loss), optional
        Called after every iteration. :func:`meshot.flow.fit_progress` makes one that shows a progress bar.
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
        n_crossings = len(self_intersecting_faces(carried(state, mesh, settings)))
        if n_crossings > guard.max_crossings:
            raise ValueError(
                f"{n_crossings} faces cross before the fit begins, {guard.max_crossings} are allowed: there is no "
                "state to go back to; mend the mesh, or allow as many in the guard"
            )
    made_with = dataclasses.asdict(settings) | {"guard": None if guard is None else dataclasses.asdict(guard)}

    def tell(done: int, n_iterations: int, line: dict) -> None:
        if progress is not None and "loss" in line:
            progress(done, line["loss"])

    stages = field.stages()

    def loss_of(i: int) -> tuple[Tensor, str]:
        generator = np.random.default_rng([settings.seed, i])
        return loss(carried(state, mesh, settings), settings.n_directions_at(i), generator), "of the fit"

    def hold_fine_stages(i: int) -> None:
        for parameter in itertools.chain(*stages[settings.n_stages_at(i, len(stages)) :]):
            parameter.grad = None  # Adam skips parameters without a gradient

    def is_given_up() -> bool:
        return guard is not None and sum(line.get("backtracked", False) for line in state.lines) >= guard.max_backtracks

    def check(_: int) -> dict:
        """The log entry of a check. With a guard, the fit backtracks if too many faces intersect."""
        generator = np.random.default_rng([settings.seed, settings.n_iterations])
        with torch.no_grad():
            moved = carried(state, mesh, settings)
            value = float(loss(moved, settings.n_directions[1], generator))
        watched = {} if watch is None else {name: float(number) for name, number in watch(moved).items()}
        for name in watched.keys() & set(HISTORY):
            raise ValueError(
                f"what is watched is called {name!r}, which the history holds anyway; give it another name"
            )
        found = {"validation_loss": value, "checked_loss": value, "watched": watched}
        if guard is not None:
            crossings = len(self_intersecting_faces(moved))
            found |= {"checked_crossings": crossings, "backtracked": crossings > guard.max_crossings}
            if found["backtracked"]:
                backtrack(state, mesh, settings, guard)
                found["validation_loss"] = None
        return found

    task = Task(loss_of, check, hold_fine_stages, is_given_up)
    train(state, settings.plan(), task, made_with, checkpoint, None, tell)
    with torch.no_grad():
        result = carried(state, mesh, settings)
    history: dict[str, list[float]] = {name: [] for name in HISTORY}  # the entries of the log as columns
    for line in state.lines:
        if "loss" in line:
            i = line["step"] - 1
            new = {"iteration": i, "loss": line["loss"], "n_directions": settings.n_directions_at(i)}
        else:
            new = {"checked_iteration": line["step"], "checked_loss": line["checked_loss"]} | line["watched"]
            new |= {name: line[name] for name in ("checked_crossings",) if name in line}
            new |= {"backtrack_iteration": line["step"]} if line.get("backtracked") else {}
        for name, value in new.items():
            history.setdefault(name, []).append(value)
    return Fit(field, result, history, state.best_step, state.n_steps)


def sliced_loss(target: Mesh, encoding: Encoding, p: float = 2) -> FitLoss:
    """The sliced Wasserstein loss to ``target`` with new directions in every iteration, for ``fit_flow``.

    An encoding is, for example, ``lambda mesh: varifold(mesh, normal_scale=8.0)``; p is the exponent of the cost.
    """
    encoded = encoding(target)

    def loss(mesh: Mesh, n_directions: int, generator: np.random.Generator) -> Tensor:
        return sliced_wasserstein(encoding(mesh), encoded, n_directions, p, seed=generator)

    return loss


# Deformation of one mesh into another in one call, for meshes of any size and in any unit.

MeshLoss = Callable[[Mesh, Mesh], Tensor]
# All in units of half the longest side of the box that contains both meshes. The values were chosen for folded spheres
# of radius 40 mm: grids of 24, 12, 6 and 3 mm, a margin of 12 mm, a learning rate of .3 mm, and normals of 8 mm.
_N_LEVELS, _MARGIN, _LEARNING_RATE, _NORMAL_SCALE = 4, 0.3, 0.0075, 0.2
#: The longest edge of the faces that the default loss compares, and the largest mean distance of the result from the
#: target that is not called doubtful, both in spacings of the finest grid.
_LONGEST_EDGE, _DOUBTFUL = 2.0, 0.5
_N_JUDGED = 10_000  # points on each surface that are measured to the other


@dataclasses.dataclass(frozen=True, eq=False)
class Deformation:
    """A deformed mesh, and the flow that deforms it.

    Parameters
    ----------
    mesh : Mesh
        The source after the flow: the same faces, other vertices.
    flow : GridVelocity
        The velocity field, in the units of the mesh per unit of time.
    n_steps : int
        Number of Euler steps.
    losses : tuple of float
        The loss at every check of the fit, divided by the loss of the source.
    distance : float
        The mean distance between the deformed mesh and the target, over points of both, in the units of the meshes.
    doubts : tuple of str
        Why the result may not be what is wanted, in words. They were also given as warnings.

    Examples
    --------
    >>> import meshot
    >>> from meshot.mesh.shapes import cube, icosphere
    >>> result = meshot.deform(icosphere(1), icosphere(1, 1.1), n_iterations=2, detail=0.3, progress=False)
    >>> result.carry(cube(0.1).vertices).shape
    torch.Size([8, 3])
    """

    mesh: Mesh
    flow: GridVelocity
    n_steps: int
    losses: tuple[float, ...]
    distance: float
    doubts: tuple[str, ...] = ()

    def carry(self, points: Float[Tensor, "n 3"], inverse: bool = False) -> Float[Tensor, "n 3"]:
        """Move other points by the flow, from the space of the source to that of the target, or back (``inverse``)."""
        return integrate(self.flow, points, self.n_steps, inverse=inverse)


def deform(
    source: Mesh,
    target: Mesh,
    loss: MeshLoss | None = None,
    *,
    n_iterations: int = 300,
    detail: float = 0.075,
    allow_crossings: bool = False,
    seed: int = 0,
    progress: bool = True,
) -> Deformation:
    """Deform the source into the target by a smooth flow that minimises a loss.

    A velocity field on nested grids is fitted with Adam by :func:`meshot.flow.fit_flow`. All lengths are
    relative to the size of the meshes: if both meshes are scaled or shifted, the result is scaled or shifted with them,
    up to rounding. If no check has a lower loss than the source, the result is the source with a zero velocity.

    Parameters
    ----------
    source, target : Mesh
        Roughly aligned, with the same topology. They may have any numbers of vertices and faces, and need no
        correspondence. The vertices of the source move, and keep their order; between them its faces stay flat, so that
        a source with few vertices cannot follow a curved target.
    loss : callable of (mesh, mesh), optional
        A differentiable loss between the deformed mesh and the target, such as :func:`meshot.chamfer`, in the units of
        the meshes. The default is the sliced Wasserstein loss between varifolds, with new directions in every
        iteration, and with unit normals scaled to a fifth of half the longest side of the box that contains both
        meshes. For it, faces with edges longer than two spacings of the finest grid are divided, so that a box of 12
        faces is as good a target as the same box of 3000.
    n_iterations : int
        Number of iterations of Adam.
    detail : float
        Spacing of the finest grid, in units of half the longest side of the box that contains both meshes. Half the
        value resolves finer folds and needs eight times the memory.
    allow_crossings : bool
        If false, the fit backtracks whenever the deformed mesh intersects itself, see
        :class:`meshot.flow.Guard`.
    seed : int
        Seed of the directions.
    progress : bool
        Whether to show a progress bar on standard error.

    Raises
    ------
    ValueError
        If an argument is not a mesh, the meshes differ in dtype or device, a number is outside its range, the source
        intersects itself although ``allow_crossings`` is false, or the loss is not a finite number with a gradient.

    Warns
    -----
    UserWarning
        If the result is doubtful: source and target differ in topology, which no flow changes; the result is on average
        farther from the target than half the spacing of the finest grid; or its faces intersect.

    Notes
    -----
    With faces that are not divided, an iteration takes some milliseconds per thousand faces. A loss of continuous
    surfaces takes longer: :func:`meshot.sliced_wasserstein` of two meshes of 150 000 faces 4 s.

    References
    ----------
    Le et al., *Diffeomorphic Mesh Deformation via Efficient Optimal Transport*, ICLR 2024, Algorithm 1, here applied
    to one pair of meshes.

    Examples
    --------
    >>> import meshot
    >>> from meshot.mesh.shapes import folded_sphere, icosphere
    >>> start, target = icosphere(1, 1.0), folded_sphere(1, radius=1.0, depth=0.2)
    >>> result = meshot.deform(start, target, n_iterations=10, detail=0.3, progress=False)
    >>> result.mesh
    Mesh(42 vertices, 80 faces, torch.float64)
    >>> result.losses[-1] < 1
    True
    """
    for name, value in (("source", source), ("target", target)):
        if not isinstance(value, Mesh):
            raise ValueError(
                f"{name} is a {type(value).__qualname__}; a meshot.Mesh is needed: Mesh(vertices, faces), "
                "Mesh.from_trimesh(...), Mesh.from_pyvista(...) or read_mesh(path)"
            )
    require_same_space(source.vertices, target.vertices)
    if not 0 < detail < 1:
        raise ValueError(f"detail is {detail!r}; a share in (0, 1) is needed, of half the longest side of the box")
    # The centre of the bounding box of both meshes, and half its longest side.
    everything = torch.cat([source.vertices.detach(), target.vertices.detach()])
    low, high = everything.amin(dim=0), everything.amax(dim=0)
    centre, size = (low + high) / 2, float((high - low).max()) / 2
    if not size > 0:
        raise ValueError("source and target are one point; meshes with an extent are needed")
    settings = FitSettings(n_iterations, _LEARNING_RATE, check_every=min(25, n_iterations), seed=seed)
    start, goal = (mesh.with_vertices((mesh.vertices.detach() - centre) / size) for mesh in (source, target))
    # The loss of a mesh in normalised coordinates, divided by the loss of the source, so that it has no unit.
    if loss is None:
        finer = [edge_splits(mesh, _LONGEST_EDGE * detail * size) for mesh in (source, target)]
        goal_measure = varifold(functools.reduce(with_edges_split, finer[1], target), normal_scale=_NORMAL_SCALE * size)

        def in_full(mesh: Mesh, n_directions: int, generator: np.random.Generator) -> Tensor:
            fine = functools.reduce(with_edges_split, finer[0], mesh)
            measure = varifold(fine, normal_scale=_NORMAL_SCALE * size)
            return sliced_wasserstein(measure, goal_measure, n_directions, seed=generator)

    else:

        def in_full(mesh: Mesh, n_directions: int, generator: np.random.Generator) -> Tensor:
            return loss(mesh, target)

    moving = source.with_vertices(source.vertices.detach().clone().requires_grad_())
    first = in_full(moving, settings.n_directions[1], np.random.default_rng(settings.seed))
    if not isinstance(first, Tensor) or first.numel() != 1 or not first.requires_grad:
        raise ValueError(f"the loss returned {first!r}; one number with a gradient in the vertices is needed")
    unit = abs(float(first.detach()))
    if not unit < math.inf:
        raise ValueError(f"the loss of the source is {unit}; a finite number is needed")
    del moving, first  # and the graph of the loss

    def relative(mesh: Mesh, n_directions: int, generator: np.random.Generator) -> Tensor:
        there = mesh.with_vertices(mesh.vertices * size + centre)
        return in_full(there, n_directions, generator) / (unit or 1.0)

    spacings = tuple(detail * 2**k for k in reversed(range(_N_LEVELS)))
    field = grid_around(start.vertices, goal.vertices, margin=_MARGIN, spacings=spacings)
    guard = None if allow_crossings else Guard()
    with fit_progress(settings, "deform", disable=not progress) as report:
        fit = fit_flow(field, start, relative, settings, progress=report, guard=guard)
    # The zero velocity if the best check is not below the loss of the source, with the directions of the checks.
    generator = np.random.default_rng([settings.seed, settings.n_iterations])
    with torch.no_grad():
        unmoved = float(relative(start, settings.n_directions[1], generator))
    checked = dict(zip(fit.history["checked_iteration"], fit.history["checked_loss"], strict=True))
    best = checked.get(fit.best_iteration, math.inf)  # absent if every check was rejected
    flow = (fit.field if best < unmoved else field).scaled(size, centre)
    mesh = source.with_vertices(integrate(flow, source.vertices, fit.n_steps).detach())
    # What makes the result doubtful.
    distance = average_surface_distance(*offsets_between(Surface(mesh), Surface(target), _N_JUDGED))
    doubts, kinds = [], [topology(each) for each in (source, target)]
    if kinds[0] != kinds[1]:
        doubts.append(f"source and target differ in topology, which no flow changes: {kinds[0]} and {kinds[1]}")
    spacing = detail * size
    if distance > _DOUBTFUL * spacing:
        doubts.append(
            f"the result is {distance:.3g} from the target on average, more than half the spacing {spacing:.3g} of the "
            "finest grid: take more n_iterations or a source with more vertices, or align the meshes first"
        )
    crossings = len(self_intersecting_faces(mesh))
    if crossings:
        doubts.append(f"{crossings} faces of the result intersect others: take a larger detail or other settings")
    for doubt in doubts:
        warnings.warn(f"the deformation is doubtful: {doubt}", stacklevel=2)
    return Deformation(mesh, flow, fit.n_steps, tuple(fit.history["checked_loss"]), distance, tuple(doubts))
