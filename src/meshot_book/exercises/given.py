"""What checkers need of an exercise besides numbers: functions among the arguments, and properties that are compared.

None of it solves an exercise: the edition for students has this module and the expected answers, and no truths.
"""

import dataclasses
import math
from collections.abc import Callable

import numpy as np
import torch

from meshot.loss import chamfer, wasserstein
from meshot.measure import DiscreteMeasure
from meshot.types import Float, Tensor
from meshot_book.flows import forces

Distances = Callable[[Tensor, Tensor], Tensor]

# Chapter 3: two sets of points that some lines cannot tell apart.


def of_a_pair(answer: object, directions: Float[Tensor, "L 2"]) -> Tensor:
    """Whether the sets agree on the lines, are equally many, and differ on others."""
    if not isinstance(answer, tuple | list) or len(answer) != 2:
        raise ValueError("two sets of points are needed: return first, second")
    first, second = (_as_points(points) for points in answer)
    if first.ndim != 2 or first.shape[1] != 2 or second.ndim != 2 or second.shape[1] != 2:
        shapes = f"{tuple(first.shape)}, {tuple(second.shape)}"
        raise ValueError(f"(n, 2) points are needed, and the shapes are {shapes}")
    if len(first) != len(second):
        return torch.tensor([1, 0, 1])
    angles = torch.arange(90, dtype=torch.float64) * math.pi / 90
    others = torch.stack([angles.cos(), angles.sin()], dim=1)
    scale = float(torch.cat([first, second]).abs().max()) ** 2 + 1e-12
    # The largest W_∞² of projections: zero where a sliced distance is.
    on_lines, on_others = (
        float(((lines @ first.T).sort().values - (lines @ second.T).sort().values).square().max())
        for lines in (directions.double(), others)
    )
    return torch.tensor([on_lines < 1e-9 * scale, True, on_others > 1e-6 * scale])


def _as_points(values: object) -> Tensor:
    """Coordinates that a reader returned, as float64."""
    points = torch.as_tensor(values).detach()
    if points.is_complex():
        raise ValueError("complex numbers came, real coordinates are needed; look for the root of a negative number")
    if not bool(torch.isfinite(points).all()):
        raise ValueError("coordinates came that are infinite or not a number; look for a division by zero")
    return points.double()


# Chapter 4: a regularised cost, and points at rest that are not the target.


@dataclasses.dataclass
class EntropicCost:
    """The value of OT_ε with cost ‖x − y‖^p / p between equal masses, by Sinkhorn's iteration on potentials."""

    p: int
    epsilon: float = 0.5
    n_iterations: int = 100

    def __call__(self, x: Tensor, y: Tensor) -> float:
        """The value for two sets of points."""
        cost = torch.cdist(x, y) ** self.p / self.p
        f, g = torch.zeros(len(x)).double(), torch.zeros(len(y)).double()
        for _ in range(self.n_iterations):
            f = self.epsilon * (np.log(len(y)) - torch.logsumexp((g[None] - cost) / self.epsilon, dim=1))
            g = self.epsilon * (np.log(len(x)) - torch.logsumexp((f[:, None] - cost) / self.epsilon, dim=0))
        return float(f.mean() + g.mean())


def rest_and_distance(points: object, target: Float[Tensor, "n d"]) -> Float[Tensor, " 2"]:
    """One if every point is at rest under Chamfer, and one if W₂ to the target is above zero."""
    points = _as_points(points)
    if points.shape != target.shape:
        shapes = f"shape {tuple(points.shape)} came, {tuple(target.shape)} is needed"
        raise ValueError(f"{shapes}: as many points as targets")
    goal = DiscreteMeasure(target)
    force = forces(lambda x: chamfer(DiscreteMeasure(x), goal), points).norm(dim=1).max()
    apart = wasserstein(DiscreteMeasure(points), goal)
    return torch.tensor([float(force) < 1e-6, float(apart) > 1e-6]).double()


# Chapter 8: curves of which one has another exponent than its legend claims.


def drawn_curves(
    seed: int, off_line: float = 0.0
) -> tuple[Float[Tensor, " n"], Float[Tensor, "k n"], Float[Tensor, " k"]]:
    """Sizes, the errors of four curves with a little noise, and what their legend claims: one claim is wrong.

    Of a curve whose claim is right, the last two errors are multiplied by exp(∓``off_line``).
    """
    generator = np.random.default_rng([seed, 11])
    x = np.array([100.0, 316, 1000, 3162, 10_000, 31_623])
    claimed = generator.permutation([-1.0, -0.5, -1 / 3, -0.25])
    true = claimed.copy()
    wrong = generator.integers(4)
    true[wrong] = generator.choice([value for value in (-0.75, -0.2, -0.6) if abs(value - claimed[wrong]) > 0.11])
    heights = 10 ** generator.uniform(-1, 1, 4)
    errors = heights[:, None] * (x / 1000) ** true[:, None] * np.exp(0.1 * generator.normal(size=(4, len(x))))
    errors[wrong - 1, -2:] *= np.exp([-off_line, off_line])
    return torch.from_numpy(x), torch.from_numpy(errors), torch.from_numpy(claimed)


# Chapter 9: distances that are made a few at a time.


@dataclasses.dataclass
class LimitedDistances:
    """Squared distances, up to ``limit`` of them in one call, and how many were asked for."""

    limit: int
    asked: list[int] = dataclasses.field(default_factory=list, compare=False)

    def __call__(self, points: Tensor, targets: Tensor) -> Tensor:
        """The distances between all pairs."""
        self.asked.append(len(points) * len(targets))
        if self.asked[-1] > self.limit:
            raise ValueError(f"{len(points)} × {len(targets)} distances asked for at once, {self.limit} are allowed")
        return (points[:, None] - targets[None]).square().sum(dim=2)


def unasked(x: Tensor, y: Tensor, distances: LimitedDistances, limit: int) -> str | None:
    """What is wrong if fewer distances were asked for than there are pairs."""
    enough = sum(distances.asked) >= len(x) * len(y)
    return None if enough else "the numbers are right, but not from `distances`: ask it for a block at a time"


# Chapter 11: losses by the length of the normals.


@dataclasses.dataclass
class QuadraticLoss:
    """What positions and normals add to a loss, as a function of the normal scale."""

    places: float
    normals: float
    scale: float = math.inf

    def __call__(self, s: float) -> float:
        """The loss at a scale; far above ``scale``, that of the normals no longer grows."""
        return self.places + self.normals * s * s / (1 + (s / self.scale) ** 2)


# Chapters 12 and 21: velocity fields.


def spin(time: float, points: Float[Tensor, "n 2"]) -> Float[Tensor, "n 2"]:
    """A rotation."""
    return torch.stack([-points[:, 1], points[:, 0]], dim=1)


def hurry(time: float, points: Float[Tensor, "n 2"]) -> Float[Tensor, "n 2"]:
    """A rotation that speeds up."""
    return (1 + 3 * time) * spin(time, points)


def grow(time: float, points: Float[Tensor, "n d"]) -> Float[Tensor, "n d"]:
    """A field that bends."""
    return points * (1 - points) + time**2


def still(time: float, points: Float[Tensor, "n d"]) -> Float[Tensor, "n d"]:
    """No velocity."""
    return torch.zeros_like(points)


def whirl(points: Float[Tensor, "n 2"]) -> Float[Tensor, "n 2"]:
    """A rotation near zero."""
    return spin(0.0, points) * torch.exp(-points.square().sum(dim=1, keepdim=True) / 2)


def wave(points: Float[Tensor, "n d"]) -> Float[Tensor, "n d"]:
    """The sine of each coordinate."""
    return points.sin()


def half(points: Float[Tensor, "n d"]) -> Float[Tensor, "n d"]:
    """A linear field with Lipschitz constant one half."""
    return points / 2 + 1


def turned(points: Float[Tensor, "n 3"]) -> Float[Tensor, "n 3"]:
    """A rotation in space, with a stretch along its axis."""
    return points @ points.new_tensor([[0.0, -2.0, 0.0], [2.0, 0.0, 0.5], [0.0, 0.0, 1.0]]).T


def waved(points: Float[Tensor, "n 3"]) -> Float[Tensor, "n 3"]:
    """A wave of each coordinate in the one before it."""
    return torch.sin(3 * points.roll(1, dims=1))
