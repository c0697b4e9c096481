"""A velocity field that is a sum of splines on several grids, from coarse to fine."""

import itertools

import torch
from torch import nn

from meshot.errors import as_floating, require_choice, require_positive_integer, require_shape
from meshot.flow.fields.field import LearnedVelocity, Prepared
from meshot.flow.fields.spline import INTERPOLATIONS, refined, spline_values
from meshot.types import Float, Tensor


class GridVelocity(LearnedVelocity):
    """A sum of B-splines on nested grids over a box, piecewise constant in time. Initially zero.

    Cubic splines are twice continuously differentiable in the box. Linear splines are only continuous: their
    derivatives jump at the faces of the cells. Both are Lipschitz. Outside the box the velocity is that of the nearest
    point in the box, which keeps the Lipschitz constant. With one time interval the field is stationary.

    Parameters
    ----------
    lower, upper : tensor or array
        Two opposite corners of the box, in mm (world coordinates), shape (3,). The box is enlarged to a whole number of
        coarse cells.
    spacings : floats
        Grid spacings in mm, from coarse to fine, each half the one before. The sum is then one spline on the finest
        grid, and a point depends on 64 coefficients instead of 64 per level.
    n_pieces : int
        Number of equal time intervals on [0, 1]. The number of integration steps should be a multiple of it, so that no
        step spans two intervals.
    interpolation : str
        "cubic" (B-spline: the velocity at a node is a mean of nearby coefficients) or "linear" (the velocity at a node
        is the coefficient).

    Raises
    ------
    ValueError
        If the box is empty, the spacings do not halve, ``n_pieces`` < 1, or the interpolation is unknown.
    """

    def __init__(
        self,
        lower: Tensor,
        upper: Tensor,
        spacings: tuple[float, ...] = (24.0, 12.0, 6.0, 3.0),
        n_pieces: int = 4,
        interpolation: str = "cubic",
    ):
        super().__init__()
        lower, upper = _require_box(lower, upper)
        _require_halving(spacings)
        require_positive_integer(n_pieces, "n_pieces")
        require_choice(interpolation, "interpolation", INTERPOLATIONS)
        self.interpolation = interpolation
        self.spacings, self.n_pieces = tuple(float(s) for s in spacings), n_pieces
        self.register_buffer("lower", lower)
        n_cells = [int(n) for n in torch.ceil((upper - lower) / spacings[0] - 1e-6).clamp(min=1)]
        self.levels = nn.ParameterList(
            lower.new_zeros(n_pieces, *(n * 2**level + 3 for n in n_cells), 3) for level in range(len(spacings))
        )

    def coefficients(self) -> Float[Tensor, "pieces nx ny nz 3"]:
        """The coefficients of the whole field on the finest grid, in mm per unit of time."""
        total = self.levels[0]
        for level in list(self.levels)[1:]:
            total = refined(total, self.interpolation) + level
        return total

    def extra_repr(self) -> str:
        """The settings that the shapes of the levels do not show."""
        return f"spacings={self.spacings}, n_pieces={self.n_pieces}, interpolation={self.interpolation}"

    def stages(self) -> list[list[nn.Parameter]]:
        """One group of parameters per level, from coarse to fine."""
        return [[level] for level in self.levels]

    def prepared(self) -> Prepared:
        """The field with one spline per time interval."""
        coefficients = self.coefficients()
        pieces = coefficients.unbind(dim=0)
        starts = torch.arange(self.n_pieces, dtype=torch.float64, device=self.lower.device) / self.n_pieces
        finest = self.spacings[-1]
        first = self.lower - finest  # every level has one node before the box and one node after it

        def velocity(time: Tensor, points: Tensor) -> Tensor:
            piece = int(torch.searchsorted(starts.to(time.dtype), time, right=True)) - 1
            nearest = pieces[min(max(piece, 0), len(pieces) - 1)]
            return spline_values(nearest, (points - first) / finest, self.interpolation)

        return Prepared(velocity, (coefficients,))

    def forward(self, time: Float[Tensor, ""], points: Float[Tensor, "n 3"]) -> Float[Tensor, "n 3"]:
        """The velocity of every point at one time, in mm per unit of time."""
        return self.prepared()(time, points)

    @torch.no_grad()
    def scaled(self, factor: float, shift: Float[Tensor, " 3"]) -> "GridVelocity":
        """The same field in coordinates y = ``factor`` · x + ``shift``."""
        n_cells = torch.tensor(self.levels[0].shape[1:4]) - 3
        lower = self.lower * factor + shift
        spacings = tuple(factor * spacing for spacing in self.spacings)
        upper = lower + n_cells.to(lower) * spacings[0]
        other = GridVelocity(lower, upper, spacings, self.n_pieces, self.interpolation)
        for level, own in zip(other.levels, self.levels):
            level.copy_(factor * own)
        return other

    @torch.no_grad()
    def lipschitz_bound(self) -> Float[Tensor, ""]:
        """A bound of the Lipschitz constant over space and time, per unit of time.

        The derivative of a linear or cubic B-spline along an axis is a convex combination of differences of
        neighbouring coefficients, divided by the spacing: ‖Dv‖ ≤ √(Σ_axes max ‖Δc‖²) / spacing. The bound becomes
        tighter as the grid becomes finer.
        """
        coefficients = self.coefficients()
        steepest = [
            torch.linalg.vector_norm(coefficients.diff(dim=axis), dim=-1).flatten(1).amax(dim=1) for axis in (1, 2, 3)
        ]
        return (torch.stack(steepest).square().sum(dim=0).sqrt() / self.spacings[-1]).amax()


def grid_around(
    *points: Float[Tensor, "_ 3"],
    margin: float = 12.0,
    spacings: tuple[float, ...] = (24.0, 12.0, 6.0, 3.0),
    n_pieces: int = 4,
    interpolation: str = "cubic",
) -> GridVelocity:
    """A zero velocity field on grids over the bounding box of all the points, enlarged by ``margin`` mm on every side.

    Raises
    ------
    ValueError
        If ``margin`` is negative, or as :class:`GridVelocity`.
    """
    if not margin >= 0:
        raise ValueError(f"margin is {margin!r}; a number >= 0 is needed, in mm")
    everything = torch.cat([p.detach() for p in points])
    lower, upper = everything.amin(dim=0) - margin, everything.amax(dim=0) + margin
    return GridVelocity(lower, upper, spacings, n_pieces, interpolation)


def single_level(
    coefficients: Float[Tensor, "pieces nx ny nz 3"], lower: Float[Tensor, " 3"], spacing: float, interpolation: str
) -> GridVelocity:
    """The field of one level with the given coefficients, in the format of :meth:`GridVelocity.coefficients`.

    Parameters
    ----------
    coefficients : tensor
    lower : tensor
        The lower corner of the box, in mm.
    spacing, interpolation
        As :class:`GridVelocity`.

    Raises
    ------
    ValueError
        As :class:`GridVelocity`.
    """
    # A level has one node before the box, one node after it, and one that closes the last cell.
    n_cells = torch.tensor(coefficients.shape[1:4]) - 3
    field = GridVelocity(lower, lower + n_cells.to(lower) * spacing, (spacing,), len(coefficients), interpolation)
    with torch.no_grad():
        field.levels[0].copy_(coefficients)
    return field


def _require_box(lower: Tensor, upper: Tensor) -> tuple[Tensor, Tensor]:
    lower, upper = as_floating(lower, "lower"), as_floating(upper, "upper")
    require_shape(lower[None], "lower", 3)
    require_shape(upper[None], "upper", 3)
    if not bool((lower < upper).all()):
        raise ValueError(f"the box from {lower.tolist()} to {upper.tolist()} is empty; lower must be below upper")
    return lower.detach().clone(), upper.detach()


def _require_halving(spacings: tuple[float, ...]) -> None:
    halves = all(abs(2 * fine - coarse) <= 1e-9 * coarse for coarse, fine in itertools.pairwise(spacings))
    if not spacings or min(spacings) <= 0 or not halves:
        raise ValueError(
            f"spacings are {spacings}; positive numbers are needed, each half the one before, such as (24, 12, 6, 3)"
        )
