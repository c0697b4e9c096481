"""The sliced loss on devices other than the CPU: directions in chunks, each with its gradient, to limit memory."""

import torch
from torch.autograd.function import once_differentiable

from meshot.loss.plain import plain_costs, power, quantile_cells, row_order, same_equal_masses
from meshot.measure import Measure
from meshot.types import Float, Tensor

_CHUNK = 1 << 22  # projected points of both sides per chunk, each of which takes about ten numbers of memory


def chunked_sliced_wasserstein(
    source: Measure, target: Measure, directions: Float[Tensor, "L d"], p: float
) -> Float[Tensor, ""]:
    """The mean of :func:`meshot.loss.plain.plain_costs` on any device, with the memory of one chunk of directions.

    The gradient is computed together with the value, as in the CPU kernel. Second derivatives, and derivatives in the
    directions, are not available.
    """
    return _Chunked.apply(source.places, source.weights, target.places, target.weights, directions, p)


@torch.no_grad()
def chunked_costs(source: Measure, target: Measure, directions: Float[Tensor, "L d"], p: float) -> Float[Tensor, " L"]:
    """The values of :func:`meshot.loss.plain.plain_costs`, without gradient, with the memory of one chunk."""
    chunks = _split(directions, len(source.places) + len(target.places))
    return torch.cat([plain_costs(source, target, chunk, p) for chunk in chunks])


def _split(directions: Tensor, n_points: int) -> tuple[Tensor, ...]:
    return directions.split(max(1, _CHUNK // n_points))


class _Chunked(torch.autograd.Function):
    @staticmethod
    def forward(ctx, x, a, y, b, directions, p):
        wanted = ctx.needs_input_grad[:4]
        sums = [torch.zeros_like(t) if w else None for t, w in zip((x, a, y, b), wanted)]
        total = directions.new_zeros(())
        paired = not (wanted[1] or wanted[3]) and same_equal_masses(a.detach(), b.detach())
        for lines in _split(directions, len(x) + len(y)):
            projected, other = lines @ x.T, lines @ y.T
            costs, gradients = (
                _paired(projected, other, p) if paired else _merged(projected, a, other, b, p, sums[1::2])
            )
            total += costs.sum()
            for to_points, gradient in zip(sums[::2], gradients):
                if to_points is not None:
                    to_points += gradient.T @ lines
        ctx.gradients = [None if g is None else g / len(directions) for g in sums]
        return total / len(directions)

    @staticmethod
    @once_differentiable
    def backward(ctx, grad_output):
        return *(None if g is None else grad_output * g for g in ctx.gradients), None, None


def _paired(x: Tensor, y: Tensor, p: float) -> tuple[Tensor, tuple[Tensor, Tensor]]:
    """For equal masses: the cost of every row, and its gradients in the projected points."""
    x_order, y_order = row_order(x), row_order(y)
    gap = x.gather(1, x_order) - y.gather(1, y_order)
    gradient = _slope(gap, p) / gap.shape[1]
    return power(gap, p).mean(dim=1), (
        torch.empty_like(x).scatter_(1, x_order, gradient),
        torch.empty_like(y).scatter_(1, y_order, -gradient),
    )


def _merged(
    x: Tensor, a: Tensor, y: Tensor, b: Tensor, p: float, to_weights: list[Tensor | None]
) -> tuple[Tensor, tuple[Tensor, Tensor]]:
    """For any masses: the cost of every row and its gradients in the projected points; adds those in the weights.

    The derivative in the end of a cell is its cost minus that of the next cell. Ends of steps are sums of weights.
    """
    cells = quantile_cells(x, a, y, b)
    cost = power(cells.gap, p)
    gradient = _slope(cells.gap, p) * cells.mass
    gradients = (
        _to_points(gradient, cells.source_step, cells.source_order),
        _to_points(-gradient, cells.target_step, cells.target_order),
    )
    if any(sums is not None for sums in to_weights):
        drops = -torch.diff(cost, dim=1, append=torch.zeros_like(cost[:, :1]))
        of_ends = torch.empty_like(drops).scatter_(1, cells.order, drops).split([x.shape[1], y.shape[1]], dim=1)
        for sums, ends, order in zip(to_weights, of_ends, (cells.source_order, cells.target_order)):
            if sums is not None:
                potential = ends.flip(1).cumsum(dim=1).flip(1)
                sums.scatter_add_(0, order.flatten(), potential.flatten())
    return (cost * cells.mass).sum(dim=1), gradients


def _to_points(gradient: Tensor, step: Tensor, order: Tensor) -> Tensor:
    """The sum of the gradients on the cells of each step, at the point of this step."""
    of_steps = gradient.new_zeros(order.shape).scatter_add_(1, step, gradient)
    return torch.empty_like(of_steps).scatter_(1, order, of_steps)


def _slope(gap: Tensor, p: float) -> Tensor:
    """The derivative of |gap|^p."""
    if p == 2:
        return 2 * gap
    return gap.sign() if p == 1 else p * gap.abs().pow(p - 1) * gap.sign()
