"""How a loss meets PyTorch: batches on threads, first and second derivatives, compilers, transforms, autocast."""

import contextlib
import functools
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

import torch

from meshot.types import Array, Float, Tensor

#: What solves one pair: from its number in the batch, its tensors, which of their gradients are wanted, and the number
#: of threads, to the value and the gradients, in float64.
Solve = Callable[[int, Sequence[Tensor], Sequence[bool], int], tuple[float, Sequence[Array | None]]]
_DEVICES = ("cpu", "cuda", "mps", "xpu")


def uncompiled(function: Callable) -> Callable:
    """Decorate a function so that ``torch.compile`` leaves it as it is: the graph breaks there."""

    @functools.wraps(function)
    def called(*args, **kwargs):
        if torch.compiler.is_compiling():  # only the compiler sees this branch
            return torch.compiler.disable(function)(*args, **kwargs)
        return function(*args, **kwargs)

    return called


def public_loss(loss: Callable) -> Callable:
    """Decorate a loss so that ``torch.compile`` leaves it as it is, and autocast does not narrow what it computes."""

    @functools.wraps(loss)
    def eager(*args, **kwargs):
        if torch._C._are_functorch_transforms_active():
            raise ValueError(
                f"{loss.__name__} is called within a transform of torch.func, such as vmap or grad, which cannot look "
                "into compiled kernels; pass a batch as one (B, n, d) tensor in place of vmap, and take gradients by "
                "torch.autograd.grad"
            )
        with contextlib.ExitStack() as stack:
            for device in _DEVICES:
                if torch.is_autocast_enabled(device):
                    stack.enter_context(torch.autocast(device, enabled=False))
            return loss(*args, **kwargs)

    return uncompiled(eager)


def solved(
    solve: Solve, pairs: Sequence[Sequence[Tensor]], again: Callable[..., Tensor] | None = None
) -> Float[Tensor, " B"]:
    """The values of all pairs of a batch, differentiable with respect to their tensors.

    Parameters
    ----------
    solve : callable
        Solves one pair. Pairs are solved on several threads, or each on all threads if there are fewer pairs.
    pairs : sequence of sequences of tensors
        The tensors of every pair, equally many. The first one determines dtype and device of the values.
    again : callable, optional
        The value of a pair, from its number and its tensors, by operations that PyTorch can differentiate twice. It is
        used for gradients with ``create_graph=True``. Without it, such a gradient cannot be differentiated further.

    Raises
    ------
    ValueError
        If a value exceeds the range of the dtype.
    """
    return _Solved.apply(solve, again, len(pairs), *(tensor for pair in pairs for tensor in pair))


class _Solved(torch.autograd.Function):
    """The values of all pairs. Their gradients are computed with the values and stored for the backward pass."""

    @staticmethod
    def forward(ctx, solve, again, n_pairs, *tensors):
        wanted, size = ctx.needs_input_grad[3:], len(tensors) // n_pairs
        n_threads = torch.get_num_threads()

        def work(k: int, n_threads: int) -> tuple[float, list[Tensor | None]]:
            own = slice(k * size, (k + 1) * size)
            value, gradients = solve(k, tensors[own], wanted[own], n_threads)
            kept = zip(gradients, tensors[own], wanted[own], strict=True)
            return value, [torch.from_numpy(g).to(t) if w else None for g, t, w in kept]

        if 1 < n_threads <= n_pairs:
            with ThreadPoolExecutor(n_threads) as pool:
                found = list(pool.map(lambda k: work(k, 1), range(n_pairs)))
        else:
            found = [work(k, n_threads) for k in range(n_pairs)]
        values = tensors[0].new_tensor([value for value, _ in found])
        if not bool(torch.isfinite(values).all()):
            raise ValueError(f"the loss exceeds the range of {values.dtype}: scale both measures down")
        ctx.again, ctx.size = again, size
        ctx.gradients = [gradient for _, gradients in found for gradient in gradients]
        # Read only if the gradient is to be differentiated. Tensors without a gradient belong to the caller.
        ctx.constants = [None if want else tensor for tensor, want in zip(tensors, wanted, strict=True)]
        ctx.save_for_backward(*(tensor for tensor, want in zip(tensors, wanted, strict=True) if want))
        return values

    @staticmethod
    def backward(ctx, grad_output):
        if torch.is_grad_enabled():  # create_graph=True
            return None, None, None, *_differentiable(ctx, grad_output)
        factors = grad_output.repeat_interleave(ctx.size)
        return None, None, None, *(None if g is None else c * g for c, g in zip(factors, ctx.gradients, strict=True))


def _differentiable(ctx, grad_output: Tensor) -> list[Tensor | None]:
    """The gradients as functions of the inputs."""
    saved, wanted = iter(ctx.saved_tensors), ctx.needs_input_grad[3:]
    tensors = [next(saved) if want else constant for constant, want in zip(ctx.constants, wanted, strict=True)]
    if ctx.again is None:
        factors = grad_output.repeat_interleave(ctx.size)
        products = [None if g is None else c * g for c, g in zip(factors, ctx.gradients, strict=True)]
        return [None if g is None else _Refused.apply(g, *tensors) for g in products]
    chosen = [k for k, want in enumerate(wanted) if want]
    own = [tensors[k : k + ctx.size] for k in range(0, len(tensors), ctx.size)]
    values = torch.stack([ctx.again(k, *pair) for k, pair in enumerate(own)])
    found = torch.autograd.grad(
        values, [tensors[k] for k in chosen], grad_output, create_graph=True, materialize_grads=True
    )
    gradients = dict(zip(chosen, found, strict=True))
    return [gradients.get(k) for k in range(len(tensors))]


def differentiable_once(tensor: Tensor) -> Tensor:
    """The same tensor. Gradients that pass through it cannot be differentiated again."""
    return _Once.apply(tensor)


class _Once(torch.autograd.Function):
    @staticmethod
    def forward(ctx, tensor):
        ctx.save_for_backward(tensor)
        return tensor.view_as(tensor)

    @staticmethod
    def backward(ctx, grad_output):
        return _Refused.apply(grad_output, *ctx.saved_tensors) if torch.is_grad_enabled() else grad_output


class _Refused(torch.autograd.Function):
    """A gradient, a function of some tensors, whose derivative is not available."""

    @staticmethod
    def forward(ctx, gradient, *tensors):
        return gradient.view_as(gradient)

    @staticmethod
    def backward(ctx, grad_output):
        raise ValueError(
            "this loss has no second derivatives, which a penalty on its gradient needs; sliced_wasserstein, "
            "windowed_sliced_wasserstein and varifold_kernel of points and chamfer have: compare points, drawn by "
            "meshot.empirical or of meshot.varifold, or detach the gradient"
        )
