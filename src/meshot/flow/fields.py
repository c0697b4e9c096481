"""Velocity fields: analytic fields, cubic B-splines on a grid, small networks; and their storage in files.

A field is a function of a time in [0, 1] and of points. It returns velocities in units of the points per unit of time.
A :class:`LearnedVelocity` has parameters that can be fitted.
"""

import abc
import dataclasses
import functools
import gzip
import itertools
import json
import os
from collections.abc import Callable
from pathlib import Path

import safetensors.torch
import torch
from safetensors import SafetensorError
from torch import nn
from torch.autograd.function import once_differentiable

from meshot.errors import as_floating, require_choice, require_positive_integer, require_shape
from meshot.files import unpacked, whole_file
from meshot.flow._kernel_spline import interpolate, interpolate_backward
from meshot.types import Float, Tensor
from meshot.workers import in_chunks

# The interface of velocity fields: a velocity for every point at every time in [0, 1], and its Lipschitz constant.

Velocity = Callable[[Tensor, Tensor], Tensor]  # (time, points) → velocities


@dataclasses.dataclass(frozen=True, eq=False)
class Prepared:
    """A velocity for repeated evaluation: everything that does not depend on the points is already computed.

    Parameters
    ----------
    velocity : callable of (time, points)
    tensors : tuple of tensor
        The tensors that the velocity depends on and that may need gradients. The adjoint method requires this list.
    """

    velocity: Velocity
    tensors: tuple[Tensor, ...] = ()

    def __call__(self, time: Float[Tensor, ""], points: Float[Tensor, "n d"]) -> Float[Tensor, "n d"]:
        """The velocity of every point at one time."""
        return self.velocity(time, points)


class VelocityField(abc.ABC):
    """A velocity v(t, x). If it is Lipschitz in x, its flow is a homeomorphism: trajectories do not meet."""

    #: Whether a finite L exists with ‖v(t, x) − v(t, y)‖ ≤ L ‖x − y‖ for all x, y and t.
    is_lipschitz: bool = True

    @abc.abstractmethod
    def __call__(self, time: Float[Tensor, ""], points: Float[Tensor, "n d"]) -> Float[Tensor, "n d"]:
        """The velocity of every point at one time."""

    @abc.abstractmethod
    def lipschitz_bound(self) -> Float[Tensor, ""]:
        """An upper bound of the Lipschitz constant in x, per unit of time; infinite if there is none. Without gradient.

        It is a number L with ‖v(t, x) − v(t, y)‖ ≤ L ‖x − y‖ for all x, y and t.
        :func:`meshot.flow.sampled_lipschitz` estimates the constant from below.
        """

    def prepared(self) -> Prepared:
        """The same field for repeated evaluation. Called once per flow, not once per step."""
        return Prepared(self)


class LearnedVelocity(nn.Module, VelocityField):
    """A velocity field with parameters that can be fitted."""

    def prepared(self) -> Prepared:
        """The field and its parameters."""
        return Prepared(self, tuple(self.parameters()))

    def stages(self) -> list[list[nn.Parameter]]:
        """Groups of parameters in the order in which a coarse-to-fine fit releases them; by default one group."""
        return [list(self.parameters())]


# Vector-valued B-splines on a lattice: their values, and the same spline on a lattice twice as fine.

INTERPOLATIONS = ("linear", "cubic")
SMALLEST_CHUNK = 2048  # points per thread; with fewer, starting a thread costs more than it saves


def spline_values(
    coefficients: Float[Tensor, "nx ny nz 3"], places: Float[Tensor, "n 3"], interpolation: str = "cubic"
) -> Float[Tensor, "n 3"]:
    """The B-spline Σ_j c_j β(u − j₁) β(v − j₂) β(w − j₃) at positions (u, v, w) in units of the lattice spacing.

    Along an axis of n nodes, numbered from 0, the cubic spline is twice continuously differentiable on [1, n − 2].
    Outside this box the value is that at the nearest point of the box, which keeps the Lipschitz constant. The linear
    spline (trilinear interpolation) uses the same box.

    Raises
    ------
    ValueError
        If an axis has fewer than four nodes.

    Notes
    -----
    A position depends on 64 coefficients (linear: 8). On a CPU, a compiled kernel computes the cubic spline, with an
    explicit first derivative; second derivatives are not available. Elsewhere PyTorch computes both kinds.
    """
    if min(coefficients.shape[:3]) < 4:
        raise ValueError(
            f"coefficients has shape {tuple(coefficients.shape)}; a cubic spline needs four nodes along every axis"
        )
    if interpolation == "linear":
        n_nodes = torch.tensor(coefficients.shape[:3], dtype=places.dtype, device=places.device)
        inside = places.clamp(min=1).minimum(n_nodes - 2)
        # grid_sample expects [-1, 1] from the first node to the last, and the axes in reverse order.
        wanted = (2 * inside / (n_nodes - 1) - 1).flip(1)
        image = coefficients.permute(3, 0, 1, 2)[None]
        values = torch.nn.functional.grid_sample(image, wanted[None, None, None], align_corners=True)
        return values[0, :, 0, 0].T
    if places.device.type == "cpu" and places.dtype in (torch.float32, torch.float64):
        return _Spline.apply(coefficients, places)
    return plain_spline_values(coefficients, places)


def plain_spline_values(
    coefficients: Float[Tensor, "nx ny nz 3"], places: Float[Tensor, "n 3"]
) -> Float[Tensor, "n 3"]:
    """The same values as :func:`spline_values`, computed by PyTorch operations on any device."""
    n_nodes = torch.tensor(coefficients.shape[:3], device=places.device)
    inside = (places >= 1) & (places <= n_nodes - 2)
    places = torch.where(inside, places, torch.minimum(places.detach().clamp(min=1), n_nodes - 2))
    cells = torch.minimum(places.detach().floor().long(), n_nodes - 3)
    weights = spline_weights(places - cells)  # (n, 3, 4)
    values = torch.zeros_like(places)
    for a in range(4):
        for b in range(4):
            for c in range(4):
                x, y, z = (cells + torch.tensor([a, b, c], device=places.device) - 1).unbind(dim=1)
                weight = weights[:, 0, a] * weights[:, 1, b] * weights[:, 2, c]
                values = values + weight[:, None] * coefficients[x, y, z]
    return values


def spline_weights(offsets: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch 4"]:
    """The four cubic B-spline weights at an offset in [0, 1). They are non-negative and sum to one."""
    t, s = offsets, 1 - offsets
    return torch.stack([s**3 / 6, 2 / 3 - t**2 * (1 - t / 2), 2 / 3 - s**2 * (1 - s / 2), t**3 / 6], dim=-1)


def refined(
    coefficients: Float[Tensor, "*batch nx ny nz 3"], interpolation: str = "cubic"
) -> Float[Tensor, "*batch mx my mz 3"]:
    """The coefficients of the same spline at half the spacing. An axis of n + 3 nodes becomes one of 2n + 3."""
    # By the two-scale relation, a cubic B-spline is a sum of five B-splines of half its width, with weights (1, 4, 6,
    # 4, 1)/8; a linear one is a sum of three, with weights (1, 2, 1)/2. A sum of splines at several spacings is
    # therefore exactly one spline at the finest spacing.
    # The last axis first, while the arrays are small; along the first axis it is one large matrix product.
    for axis in (-2, -3, -4):
        shape = coefficients.shape[axis + 1 :]
        halves = two_scale_matrix(coefficients.shape[axis], interpolation).to(coefficients)
        coefficients = (halves @ coefficients.flatten(axis + 1)).unflatten(-1, shape)
    return coefficients


@functools.cache
def two_scale_matrix(n_nodes: int, interpolation: str = "cubic") -> Float[Tensor, "m n"]:
    """The matrix that maps n coefficients to the 2n − 3 of the same spline at half the spacing. Node 1 stays fixed."""
    matrix = torch.zeros(2 * n_nodes - 3, n_nodes, dtype=torch.float64)
    at_nodes = (0.0, 1.0, 0.0) if interpolation == "linear" else (1 / 8, 6 / 8, 1 / 8)
    for row in range(2 * n_nodes - 3):
        weights = (1 / 2, 1 / 2) if row % 2 == 0 else at_nodes
        matrix[row, row // 2 : row // 2 + len(weights)] = torch.tensor(weights, dtype=torch.float64)
    return matrix


class _Spline(torch.autograd.Function):
    @staticmethod
    def forward(ctx, coefficients, places):
        coefficients, places = coefficients.contiguous(), places.contiguous()
        ctx.save_for_backward(coefficients, places)
        values = torch.empty_like(places)
        lattice, where, out = coefficients.numpy(), places.numpy(), values.numpy()
        in_chunks(lambda i, j: interpolate(lattice, where[i:j], out[i:j]), len(where), SMALLEST_CHUNK)
        return values

    @staticmethod
    @once_differentiable
    def backward(ctx, grad_output):
        coefficients, places = ctx.saved_tensors
        lattice, where, given = coefficients.numpy(), places.numpy(), grad_output.contiguous().numpy()
        to_places = torch.empty_like(places)
        out = to_places.numpy()

        def chunk(i: int, j: int) -> Tensor:
            buffer = torch.zeros_like(coefficients)
            interpolate_backward(lattice, where[i:j], given[i:j], buffer.numpy(), out[i:j])
            return buffer

        return sum(in_chunks(chunk, len(where), SMALLEST_CHUNK)), to_places


# A velocity field that is a sum of splines on several grids, from coarse to fine.


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
        lower, upper = as_floating(lower, "lower"), as_floating(upper, "upper")
        for name, corner in (("lower", lower), ("upper", upper)):
            require_shape(corner[None], name, 3)
        if not bool((lower < upper).all()):
            raise ValueError(f"the box from {lower.tolist()} to {upper.tolist()} is empty; lower must be below upper")
        lower, upper = lower.detach().clone(), upper.detach()
        halves = all(abs(2 * fine - coarse) <= 1e-9 * coarse for coarse, fine in itertools.pairwise(spacings))
        if not spacings or min(spacings) <= 0 or not halves:
            raise ValueError(
                f"spacings are {spacings}; positive numbers are needed, each half the one before, as in (24, 12, 6, 3)"
            )
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

    The lower corner of the box is in mm; spacing and interpolation are those of :class:`GridVelocity`.
    """
    # A level has one node before the box, one node after it, and one that closes the last cell.
    n_cells = torch.tensor(coefficients.shape[1:4]) - 3
    field = GridVelocity(lower, lower + n_cells.to(lower) * spacing, (spacing,), len(coefficients), interpolation)
    with torch.no_grad():
        field.levels[0].copy_(coefficients)
    return field


# Storage of a fitted velocity field in a small file, so that its flow can be applied to other meshes.

#: Maximum size of a stored velocity field after decompression, in bytes.
LARGEST_BYTES = 1 << 28


def quantised_velocity(field: GridVelocity, step: float = 2.0**-5) -> GridVelocity:
    """The same field as one level on its finest grid, its coefficients rounded to multiples of ``step``.

    :func:`write_velocity` stores this field. Velocities change by at most half of ``step``, in mm per unit of time.

    Raises
    ------
    ValueError
        If ``step`` is not positive, or so small that the coefficients do not fit into 16 bits.
    """
    if not step > 0:
        raise ValueError(f"step is {step!r}; a positive number of mm per unit of time is needed")
    whole = (field.coefficients().detach() / step).round()
    if float(whole.abs().max()) > 32767:
        raise ValueError(f"coefficients reach {float(whole.abs().max()):.0f} steps of {step}; take a larger step")
    return single_level(whole * step, field.lower, field.spacings[-1], field.interpolation)


def write_velocity(path: str | os.PathLike, field: GridVelocity, step: float = 2.0**-5) -> None:
    """Write the coefficients on the finest grid as 16-bit multiples of ``step`` to a gzipped safetensors file.

    Raises
    ------
    ValueError
        If the suffix is not ``.safetensors.gz``, or as :func:`quantised_velocity`.
    """
    if not str(path).endswith(".safetensors.gz"):
        raise ValueError(f"{Path(path).name} does not end in .safetensors.gz; a path with this suffix is needed")
    coefficients = quantised_velocity(field, step).coefficients().detach()
    tensors = {
        # Component first: neighbouring values are then similar, and gzip saves a fifth of the bytes.
        "coefficients": (coefficients / step).round().to(torch.int16).movedim(-1, 0).contiguous(),
        "lower": field.lower.double().contiguous(),
    }
    header = {"step": step, "spacing": field.spacings[-1], "dtype": str(coefficients.dtype)}
    if field.interpolation != "cubic":  # files without this entry are cubic
        header["interpolation"] = field.interpolation
    with whole_file(path) as temporary:
        # A fixed time stamp in the header, so that the same field gives the same bytes.
        temporary.write_bytes(
            gzip.compress(safetensors.torch.save(tensors, {"velocity": json.dumps(header)}), compresslevel=9, mtime=0)
        )


def read_velocity(path: str | os.PathLike) -> GridVelocity:
    """Read a file of :func:`write_velocity`: a field of one level on the finest grid.

    Raises
    ------
    ValueError
        If the file is missing, truncated, or of another kind.
    """
    try:
        content = unpacked(path, LARGEST_BYTES)
        length = int.from_bytes(content[:8], "little")
        header = json.loads(json.loads(content[8 : 8 + length])["__metadata__"]["velocity"])
        tensors = safetensors.torch.load(content)
        dtype = {"torch.float32": torch.float32, "torch.float64": torch.float64}[header["dtype"]]
        values, lower = tensors["coefficients"].movedim(0, -1).to(dtype) * header["step"], tensors["lower"].to(dtype)
        return single_level(values, lower, header["spacing"], header.get("interpolation", "cubic"))
    except (LookupError, OSError, ValueError, TypeError, AttributeError, RuntimeError, SafetensorError) as error:
        raise ValueError(
            f"{path} is not a complete velocity file ({error}); copy it again, or repeat the fit"
        ) from error
