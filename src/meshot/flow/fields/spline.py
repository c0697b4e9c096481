"""Vector-valued B-splines on a lattice: their values, and the same spline on a lattice twice as fine."""

import functools

import torch
from torch.autograd.function import once_differentiable

from meshot.flow.fields._kernel_spline import interpolate, interpolate_backward
from meshot.threads import in_chunks
from meshot.types import Float, Tensor

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
        return _linear_values(coefficients, places)
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


def _linear_values(coefficients: Float[Tensor, "nx ny nz 3"], places: Float[Tensor, "n 3"]) -> Float[Tensor, "n 3"]:
    n_nodes = torch.tensor(coefficients.shape[:3], dtype=places.dtype, device=places.device)
    inside = places.clamp(min=1).minimum(n_nodes - 2)
    # grid_sample expects [-1, 1] from the first node to the last, and the axes in reverse order.
    wanted = (2 * inside / (n_nodes - 1) - 1).flip(1)
    image = coefficients.permute(3, 0, 1, 2)[None]
    values = torch.nn.functional.grid_sample(image, wanted[None, None, None], align_corners=True)
    return values[0, :, 0, 0].T


def spline_weights(offsets: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch 4"]:
    """The four cubic B-spline weights at an offset in [0, 1). They are non-negative and sum to one."""
    t, s = offsets, 1 - offsets
    return torch.stack([s**3 / 6, 2 / 3 - t**2 * (1 - t / 2), 2 / 3 - s**2 * (1 - s / 2), t**3 / 6], dim=-1)


def refined(
    coefficients: Float[Tensor, "*batch nx ny nz 3"], interpolation: str = "cubic"
) -> Float[Tensor, "*batch mx my mz 3"]:
    """The coefficients of the same spline at half the spacing. An axis of n + 3 nodes becomes one of 2n + 3.

    By the two-scale relation, a cubic B-spline is a sum of five B-splines of half its width, with weights
    (1, 4, 6, 4, 1)/8; a linear one is a sum of three, with weights (1, 2, 1)/2. A sum of splines at several spacings is
    therefore exactly one spline at the finest spacing.
    """
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
