"""Settings of a fit, and of its backtracking."""

import dataclasses
import math

from meshot.errors import require_choice, require_positive, require_positive_integer
from meshot.flow.integration import GRADIENTS, METHODS
from meshot.train import Plan


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

    Raises
    ------
    ValueError
        If a number is outside its range.
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
