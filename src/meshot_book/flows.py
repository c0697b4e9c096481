"""Velocity fields whose flow is known in closed form, to test integrators and bounds."""

import abc
import dataclasses
import itertools
import math
from collections.abc import Callable, Sequence

import torch
from scipy.spatial import cKDTree
from torch import nn

from meshot.errors import as_floating, require_finite, require_positive, require_positive_integer, require_shape
from meshot.flow import (
    GridVelocity,
    LearnedVelocity,
    PathReport,
    Velocity,
    VelocityField,
    inspect_paths,
    integrate,
    single_level,
    trajectory,
)
from meshot.mesh import Mesh, self_intersecting_faces
from meshot.rng import Generator, numpy_generator
from meshot.types import Float, Tensor


class AnalyticField(VelocityField):
    """A field with a closed-form flow and a known Lipschitz constant."""

    @abc.abstractmethod
    def flow(self, points: Float[Tensor, "n d"], start: float = 0.0, end: float = 1.0) -> Float[Tensor, "n d"]:
        """Positions at time ``end`` of points that are at ``points`` at time ``start``; ``end`` may be earlier."""


@dataclasses.dataclass(frozen=True, eq=False)
class Affine(AnalyticField):
    """v = A x + b. The flow is given by the matrix exponential; the Lipschitz constant is the spectral norm of A."""

    matrix: Float[Tensor, "d d"]
    offset: Float[Tensor, " d"] | None = None  # b, zero by default

    def __post_init__(self):
        matrix = as_floating(self.matrix, "matrix")
        if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1]:
            raise ValueError(f"matrix has shape {tuple(matrix.shape)}; (d, d) is needed")
        offset = matrix.new_zeros(len(matrix)) if self.offset is None else as_floating(self.offset, "offset")
        if offset.shape != (len(matrix),):
            raise ValueError(f"offset has shape {tuple(offset.shape)}; ({len(matrix)},) is needed, as for the matrix")
        object.__setattr__(self, "offset", offset)

    def __call__(self, time: Float[Tensor, ""], points: Float[Tensor, "n d"]) -> Float[Tensor, "n d"]:
        """The velocity of every point."""
        return points @ self.matrix.to(points).T + self.offset.to(points)

    def flow(self, points: Float[Tensor, "n d"], start: float = 0.0, end: float = 1.0) -> Float[Tensor, "n d"]:
        """The flow map: the matrix exponential of A, with b as an additional column."""
        d = len(self.matrix)
        wide = self.matrix.new_zeros(d + 1, d + 1)
        wide[:d, :d], wide[:d, d] = self.matrix, self.offset
        moved = torch.linalg.matrix_exp((end - start) * wide).to(points)
        return points @ moved[:d, :d].T + moved[:d, d]

    @torch.no_grad()
    def lipschitz_bound(self) -> Float[Tensor, ""]:
        """The largest singular value of the matrix, which is the exact constant."""
        return torch.linalg.matrix_norm(self.matrix, ord=2)


def rotation(angle: float) -> Affine:
    """The rotation of the plane by ``angle`` radians in unit time. Its Lipschitz constant is ``|angle|``."""
    return spiral(angle, 0.0)


def spiral(angle: float, growth: float) -> Affine:
    """A rotation of the plane combined with scaling by exp(``growth``) in unit time."""
    # Its Lipschitz constant is √(angle² + growth²).
    return Affine(torch.tensor([[growth, -angle], [angle, growth]], dtype=torch.float64))


def shear(rate: float) -> Affine:
    """(x, y) ↦ (x + rate · y, y) in unit time. Its Lipschitz constant is ``|rate|``, and one Euler step is exact."""
    return Affine(torch.tensor([[0.0, rate], [0.0, 0.0]], dtype=torch.float64))


@dataclasses.dataclass(frozen=True, eq=False)
class Vortex(AnalyticField):
    """A rotation about an axis with angular velocity ω(r) = strength · exp(−r² / (2 radius²)), in the first two axes.

    The angular velocity is constant on each circle, so the flow is known in closed form.
    ``‖Dv‖ = max(|ω|, |ω + r ω′|) ≤ |strength|``, with equality at the axis.

    Parameters
    ----------
    strength : float
        Angular velocity at the axis, in radians per unit of time.
    radius : float
        Distance from the axis at which the angular velocity is exp(−1/2) times that at the axis, in units of the
        points.

    Raises
    ------
    ValueError
        If the radius is not positive.
    """

    strength: float
    radius: float = 1.0

    def __post_init__(self):
        require_positive(self.radius, "radius")

    def _angles(self, points: Tensor) -> Float[Tensor, "n 1"]:
        return self.strength * torch.exp(-points[:, :2].square().sum(dim=1, keepdim=True) / (2 * self.radius**2))

    def __call__(self, time: Float[Tensor, ""], points: Float[Tensor, "n d"]) -> Float[Tensor, "n d"]:
        """The velocity of every point."""
        turned = torch.stack([-points[:, 1], points[:, 0]], dim=1)
        return torch.cat([self._angles(points) * turned, torch.zeros_like(points[:, 2:])], dim=1)

    def flow(self, points: Float[Tensor, "n d"], start: float = 0.0, end: float = 1.0) -> Float[Tensor, "n d"]:
        """Positions after rotation of every point about the axis by its own angle."""
        angles, x, y = (end - start) * self._angles(points), points[:, :1], points[:, 1:2]
        cosines, sines = angles.cos(), angles.sin()
        return torch.cat([cosines * x - sines * y, sines * x + cosines * y, points[:, 2:]], dim=1)

    def lipschitz_bound(self) -> Float[Tensor, ""]:
        """``|strength|``, which is the exact constant."""
        return torch.tensor(abs(self.strength), dtype=torch.float64)


@dataclasses.dataclass(frozen=True, eq=False)
class Push(AnalyticField):
    """A velocity along the second axis: v = strength · exp(−ρ² / (2 width²)), where ρ is the distance from that axis.

    Motion along the axis does not change ρ, so one Euler step is exact for any strength.

    Parameters
    ----------
    strength : float
        Velocity on the axis, in units of the points per unit of time.
    width : float
        In units of the points. The Lipschitz constant is ``|strength| / (width · √e)``.

    Raises
    ------
    ValueError
        If the width is not positive.
    """

    strength: float
    width: float = 1.0

    def __post_init__(self):
        require_positive(self.width, "width")

    def __call__(self, time: Float[Tensor, ""], points: Float[Tensor, "n d"]) -> Float[Tensor, "n d"]:
        """The velocity of every point."""
        aside = points.clone()
        aside[:, 1] = 0
        speed = self.strength * torch.exp(-aside.square().sum(dim=1) / (2 * self.width**2))
        along = torch.zeros(points.shape[1], dtype=points.dtype, device=points.device)
        along[1] = 1
        return speed[:, None] * along

    def flow(self, points: Float[Tensor, "n d"], start: float = 0.0, end: float = 1.0) -> Float[Tensor, "n d"]:
        """The position plus velocity times elapsed time."""
        return points + (end - start) * self(points.new_tensor(start), points)

    def lipschitz_bound(self) -> Float[Tensor, ""]:
        """The exact constant, ``|strength| / (width · √e)``."""
        return torch.tensor(abs(self.strength) * math.exp(-0.5) / self.width, dtype=torch.float64)


# A velocity field computed by a small network from position and time.


class NetworkVelocity(LearnedVelocity):
    """A multilayer perceptron of position and, optionally, time, with tanh between its layers. It is smooth everywhere.

    Parameters
    ----------
    n_dimensions : int
        Dimension of the points and of the velocities.
    width, n_layers : int
        Neurons per hidden layer, and number of hidden layers.
    generator : numpy.random.Generator, torch.Generator or int
        Source of the initial weights, which are normal with standard deviation 1/√(inputs); biases are uniform in
        [−1, 1].
    extent : float
        Positions are divided by it before they enter the network. About half the size of the shape is suitable.
    last_scale : float
        Scale of the initial weights of the last layer. With 0 the velocity is initially zero.
    with_time : bool
        Whether time is an additional input. Otherwise the field is stationary.

    Raises
    ------
    ValueError
        If a count is not a positive integer, or ``extent`` is not positive.
    """

    def __init__(
        self,
        n_dimensions: int,
        width: int = 64,
        n_layers: int = 2,
        generator: Generator = 0,
        extent: float = 1.0,
        last_scale: float = 0.0,
        with_time: bool = True,
    ):
        super().__init__()
        for name, count in (("n_dimensions", n_dimensions), ("width", width), ("n_layers", n_layers)):
            require_positive_integer(count, name)
        if not extent > 0:
            raise ValueError(f"extent is {extent!r}; a positive length is needed, in units of the points")
        self.n_dimensions, self.extent, self.with_time = n_dimensions, float(extent), with_time
        generator = numpy_generator(generator)
        sizes = [n_dimensions + with_time, *[width] * n_layers, n_dimensions]
        self.weights, self.biases = nn.ParameterList(), nn.ParameterList()
        for index, (n_in, n_out) in enumerate(itertools.pairwise(sizes)):
            scale = last_scale if index == n_layers else 1.0
            self.weights.append(torch.from_numpy(scale / n_in**0.5 * generator.standard_normal((n_out, n_in))))
            self.biases.append(torch.from_numpy(scale * generator.uniform(-1, 1, n_out)))

    def forward(self, time: Float[Tensor, ""], points: Float[Tensor, "n d"]) -> Float[Tensor, "n d"]:
        """The velocity of every point at one time."""
        values = points / self.extent
        if self.with_time:
            values = torch.cat([values, time.to(points).expand(len(points), 1)], dim=1)
        for index, (weight, bias) in enumerate(zip(self.weights, self.biases)):
            values = nn.functional.linear(values if index == 0 else values.tanh(), weight, bias)
        return values

    @torch.no_grad()
    def lipschitz_bound(self) -> Float[Tensor, ""]:
        """The product of the spectral norms of the layers, per unit of time. The slope of tanh is at most one."""
        # In the first layer only the columns of the position count. The bound is not tight, because the layers do not
        # all stretch the same direction.
        first = self.weights[0][:, : self.n_dimensions] / self.extent
        norms = [torch.linalg.matrix_norm(weight, ord=2) for weight in [first, *list(self.weights)[1:]]]
        return torch.stack(norms).prod()


# Sequences of flows applied one after another. Each may have its own field, step number and method.


@dataclasses.dataclass(frozen=True, eq=False)
class Leg:
    """One flow of a sequence: a field and its integration settings."""

    field: VelocityField | Velocity
    # n_steps, method: as in :func:`meshot.integrate`
    n_steps: int = 12
    method: str = "euler"


def chain_end(legs: Sequence[Leg], points: Float[Tensor, "n d"]) -> Float[Tensor, "n d"]:
    """Positions of the points after all flows, applied in order. Without flows, the points. Differentiable."""
    for leg in legs:
        points = integrate(leg.field, points, leg.n_steps, leg.method)
    return points


def chain_trajectory(legs: Sequence[Leg], points: Float[Tensor, "n d"]) -> Float[Tensor, "k n d"]:
    """Positions of the points before the first step of the first flow and after each step of each flow."""
    positions = points[None]
    for leg in legs:
        after = trajectory(leg.field, positions[-1], leg.n_steps, leg.method)[1:]
        positions = torch.cat([positions, after])
    return positions


def chain_reports(legs: Sequence[Leg], points: Float[Tensor, "n d"]) -> list[PathReport]:
    """The report of :func:`meshot.flow.inspect_paths` for every flow, along the paths of the points."""
    reports = []
    for leg in legs:
        reports.append(inspect_paths(leg.field, points, leg.n_steps, leg.method))
        points = reports[-1].positions[-1]
    return reports


# Gradient descent on the positions of free points, without connectivity between them.

PointLoss = Callable[[Tensor], Tensor]


@dataclasses.dataclass(frozen=True, eq=False)
class Descent:
    """The result of a descent: the loss before every step, and the points after selected steps."""

    losses: Float[Tensor, " n_steps"]  # entry k is the loss before the (k + 1)-th step
    steps: tuple[int, ...]  # the numbers of steps after which the points were stored, in ascending order
    snapshots: Float[Tensor, "k n d"]  # the points after these numbers of steps

    @property
    def points(self) -> Float[Tensor, "n d"]:
        """The last stored points."""
        return self.snapshots[-1]

    def at(self, step: int) -> Float[Tensor, "n d"]:
        """The points after ``step`` steps."""
        if step not in self.steps:
            raise ValueError(f"step is {step}; points were kept only after {self.steps}: ask for it in `keep`")
        return self.snapshots[self.steps.index(step)]


def descend(
    loss: PointLoss,
    points: Float[Tensor, "n d"],
    n_steps: int = 1000,
    learning_rate: float = 1.0,
    momentum: float = 0.9,
    keep: Sequence[int] | None = None,
) -> Descent:
    """Minimise a loss over the positions of free points, by stochastic gradient descent with momentum."""
    # This is the toy experiment of the paper. The step is v ← momentum · v + ∇loss(x), then x ← x − learning_rate · v,
    # from v = 0, as in ``torch.optim.SGD``. Along a direction of curvature c (loss = c x² / 2) it is stable if and only
    # if 0 < learning_rate · c < 2 (1 + momentum).
    points = as_floating(points, "points")
    require_shape(points, "points", None)
    require_positive_integer(n_steps, "n_steps")
    if not learning_rate > 0:
        raise ValueError(f"learning_rate is {learning_rate!r}; a number > 0 is needed")
    if not 0 <= momentum < 1:
        raise ValueError(f"momentum is {momentum!r}; a number in [0, 1) is needed")
    wanted = tuple(sorted({int(step) for step in keep or ()} | {n_steps}))
    if wanted[0] < 0 or wanted[-1] > n_steps:
        raise ValueError(f"keep asks for steps from {wanted[0]} to {wanted[-1]}; they must lie in [0, {n_steps}]")
    moving = points.detach().clone().requires_grad_()
    optimiser = torch.optim.SGD([moving], lr=learning_rate, momentum=momentum)
    losses, snapshots = [], [points.detach().clone()] if 0 in wanted else []
    for step in range(1, n_steps + 1):
        optimiser.zero_grad()
        value = loss(moving)
        value.backward()
        optimiser.step()
        losses.append(value.detach())
        if step in wanted:
            require_finite(moving, f"points after {step} steps (try a smaller learning_rate)")
            snapshots.append(moving.detach().clone())
    return Descent(torch.stack(losses), wanted, torch.stack(snapshots))


# Descent directions of a loss of points, at the points and at additional positions.


def forces(loss: PointLoss, points: Float[Tensor, "n d"]) -> Float[Tensor, "n d"]:
    """The force on every point: −n/2 times the gradient of the loss, where n is the number of points."""
    # The factor cancels the mean over n points and the factor 2 of a squared distance. For the mean of the squared
    # distances ‖xᵢ − yᵢ‖², the force on xᵢ is yᵢ − xᵢ, in units of the points.
    points = as_floating(points, "points")
    require_shape(points, "points", None)
    moving = points.detach().clone().requires_grad_()
    (gradient,) = torch.autograd.grad(loss(moving), moving)
    return -len(points) / 2 * gradient


def probe_forces(loss: PointLoss, points: Float[Tensor, "n d"], probes: Float[Tensor, "k d"]) -> Float[Tensor, "k d"]:
    """The force on an additional point at each probe position: one probe at a time is appended to the points."""
    # Needs one evaluation of the loss per probe.
    return torch.stack([forces(loss, torch.cat([points, probe[None]]))[-1] for probe in probes])


# Local damping of a velocity field: set it to zero near the faces that its flow makes intersect.


@torch.no_grad()
def damped(field: GridVelocity, places: Float[Tensor, "n 3"], radius: float) -> GridVelocity:
    """A copy of the field that is zero near the given positions at all times, as one level on the finest grid."""
    # Coefficients at most ``radius`` from a position become zero. Between ``radius`` and twice ``radius`` they are
    # scaled by a factor that rises linearly from 0 to 1. The result is a spline, so the field stays as smooth as
    # before.
    places = as_floating(places, "places")
    require_shape(places, "places", 3)
    if not radius > 0:
        raise ValueError(f"radius is {radius!r}; a positive number of mm is needed")
    coefficients, spacing = field.coefficients(), field.spacings[-1]
    axes = [
        first + spacing * torch.arange(-1, n - 1, dtype=torch.float64)
        for first, n in zip(field.lower.tolist(), coefficients.shape[1:4], strict=True)
    ]
    nodes = torch.stack(torch.meshgrid(*axes, indexing="ij"), dim=-1)
    distances = cKDTree(places.cpu().numpy()).query(nodes.flatten(0, 2).numpy(), distance_upper_bound=2 * radius)[0]
    share = (torch.from_numpy(distances).view(nodes.shape[:3]) / radius - 1).clamp(0, 1).to(coefficients)
    return single_level(coefficients * share[None, ..., None], field.lower, spacing, field.interpolation)


def without_crossings(
    field: GridVelocity, mesh: Mesh, n_steps: int = 12, method: str = "euler", radius: float = 3.0, max_rounds: int = 20
) -> GridVelocity:
    """The field, damped near every face of the mesh that its flow makes intersect another face."""
    # Each round moves the mesh, finds the faces that intersect at the end, and damps the field along the paths of their
    # vertices. The radius grows by ``radius`` after every third round. The field does not change elsewhere, and its
    # flow remains that of a smooth field. Near the damped faces the mesh is less close to the target.
    # :class:`meshot.flow.Guard` instead changes the fit as a whole.
    require_positive_integer(max_rounds, "max_rounds")
    if len(self_intersecting_faces(mesh)):
        raise ValueError(
            "the mesh has self-intersecting faces before the flow, which damping cannot repair: repair the mesh first"
        )
    places, calmed = mesh.vertices[:0], field
    for round_ in itertools.count():
        with torch.no_grad():
            positions = trajectory(calmed, mesh.vertices, n_steps, method)
        crossing = self_intersecting_faces(mesh.with_vertices(positions[-1]))
        if not len(crossing):
            return calmed
        if round_ == max_rounds:
            raise ValueError(f"{len(crossing)} faces still cross after {max_rounds} rounds: enlarge the radius")
        corners = torch.unique(mesh.faces[crossing])
        places = torch.cat([places, positions[:, corners].flatten(0, 1)])
        calmed = damped(field, places, radius * (1 + round_ // 3))
