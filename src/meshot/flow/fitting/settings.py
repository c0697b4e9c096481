"""How a flow is fitted: the numbers, and when a fit backs off."""

import dataclasses
import math

from meshot.errors import require_positive_integer
from meshot.flow.integration import GRADIENTS, METHODS
from meshot.train import Plan


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
    n_steps, method, gradient
        As in :func:`meshot.integrate`.
    n_directions : pair of int
        How many directions the loss is given at the start and at the end; the number doubles in equal stretches.
    check_every : int
        The fit is judged by the loss with the most directions, always the same, every so many iterations.
    save_every : int
        Iterations between checkpoints, if a file for them is given.
    seed : int
        Of everything random; iteration i draws from (seed, i), so that a resumed fit draws what it would have drawn.
    patience : int, optional
        Stop early after so many checks in a row without a better loss.
    coarse_share : float
        The share of the iterations over which the levels of a field are let go one after another, coarse to fine; 0
        lets all of them move from the start.

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
        if not 0 < self.learning_rate < math.inf:
            raise ValueError(f"learning_rate is {self.learning_rate!r}; a finite number > 0 is needed, in mm")
        if len(self.n_directions) != 2 or self.n_directions[0] > self.n_directions[1]:
            raise ValueError(f"n_directions is {self.n_directions}; two counts that do not decrease are needed")
        for name, value, known in (("method", self.method, METHODS), ("gradient", self.gradient, GRADIENTS)):
            if value not in known:
                raise ValueError(f"{name} is {value!r}; one of {', '.join(known)} is needed")
        if not 0 <= self.coarse_share <= 1:
            raise ValueError(f"coarse_share is {self.coarse_share!r}; a share in [0, 1] is needed")

    def plan(self) -> Plan:
        """The same, as the engine of all trainings takes it."""
        return Plan(self.n_iterations, self.check_every, self.save_every, self.patience, self.learning_rate, "cosine")

    def n_directions_at(self, iteration: int) -> int:
        """First · 2^k, in equal stretches, up to the last."""
        first, last = self.n_directions
        n_stretches = math.ceil(math.log2(last / first)) + 1
        return min(last, first * 2 ** (iteration * n_stretches // self.n_iterations))

    def n_stages_at(self, iteration: int, n_stages: int) -> int:
        """How many of ``n_stages`` stages may move: one more in each of equal pieces of ``coarse_share``."""
        until = self.coarse_share * self.n_iterations
        return n_stages if iteration >= until else 1 + int(iteration * n_stages / until)


@dataclasses.dataclass(frozen=True, eq=False)
class Guard:
    """When a fit backs off, and how.

    At every check the faces that cross are counted, exactly. If there are more than allowed, the fit goes back to the
    best state that passed, multiplies its learning rate by ``slow_down``, and forgets its momentum. If the steps are at
    fault, because h·Lip >= 1 or a flip was met along the paths of the vertices, it also takes more of them, as many as
    the local Jacobians ask for. It gives up after ``max_retreats`` and keeps the best state.

    Parameters
    ----------
    max_crossings : int
        Faces that may cross others in the carried mesh.
    slow_down : float
        In (0, 1).
    max_retreats : int
    max_steps : int
        Never take more steps than this.

    Raises
    ------
    ValueError
        If a number is outside its range.
    """

    max_crossings: int = 0
    slow_down: float = 0.5
    max_retreats: int = 8
    max_steps: int = 64

    def __post_init__(self):
        for name in ("max_retreats", "max_steps"):
            object.__setattr__(self, name, require_positive_integer(getattr(self, name), name))
        if self.max_crossings < 0:
            raise ValueError(f"max_crossings is {self.max_crossings!r}; a count >= 0 is needed")
        if not 0 < self.slow_down < 1:
            raise ValueError(f"slow_down is {self.slow_down!r}; a factor in (0, 1) is needed")
