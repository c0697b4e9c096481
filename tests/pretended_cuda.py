"""A pretended CUDA device: each tensor on it holds a CPU tensor, and mixed devices fail as they fail on a real one.

A tensor on the pretended device says ``cuda:0``. An operation is computed by the processor on the tensors inside, after
a check of the devices. So numbers are those of a processor: the twin finds tensors on the wrong device, reading without
a copy to the processor, and kernels that cannot read such memory. It does not find what depends on a GPU: kernels that
round differently, memory, speed, or operations that are not written for CUDA.

Below PyTorch's autograd these tensors live on ``privateuseone``, the device that PyTorch keeps for other accelerators,
since a build without CUDA cannot differentiate on ``cuda``. The twin is meant for computations without gradients.
"""

import collections
import contextlib
import re
import sys
import types
from collections.abc import Iterator
from unittest.mock import patch

import pytest
import torch
import torch._dynamo  # optimisers load it, which must not happen while torch.cuda is changed
from torch.utils import backend_registration as backends
from torch.utils._mode_utils import no_dispatch
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_flatten, tree_leaves, tree_map, tree_map_only, tree_unflatten

from pretended_cuda_rules import require_one_device, require_products

if not hasattr(backends, "_DummyDeviceGuard"):
    pytest.skip(f"torch {torch.__version__} cannot register a device from Python", allow_module_level=True)

CUDA = torch.device("cuda", 0)
_BELOW = torch.device("privateuseone", 0)

#: How often each operation ran on the pretended device.
OPERATIONS: collections.Counter = collections.Counter()


def _refused(name: str):
    def method(self, *args, **kwargs):
        raise TypeError(
            f"can't convert {CUDA} device type tensor to numpy. Use Tensor.cpu() to copy the tensor to host memory "
            f"first. ({name})"
        )

    return method


class CudaTensor(torch.Tensor):
    """A tensor on the pretended device, around a tensor of the processor."""

    @staticmethod
    def __new__(cls, inner: torch.Tensor):
        """A tensor that shares the memory of ``inner``."""
        made = torch.Tensor._make_wrapper_subclass(
            cls, inner.size(), strides=inner.stride(), storage_offset=inner.storage_offset(), dtype=inner.dtype,
            device=_BELOW,
        )  # fmt: skip
        made.inner = inner
        return made

    #: Memory of a GPU cannot be read by NumPy or by compiled code of the processor.
    numpy, __array__, __dlpack__, data_ptr = (
        _refused(name) for name in ("numpy", "__array__", "__dlpack__", "data_ptr")
    )
    device, is_cuda = property(lambda self: CUDA), property(lambda self: True)

    def get_device(self) -> int:
        """The index of the device."""
        return 0

    def tolist(self) -> list:
        """Python's numbers: this one copies to the processor by itself."""
        return self.detach().inner.tolist()

    def __repr__(self) -> str:
        """The tensor inside, and the device."""
        return f"{self.inner!r} on {CUDA}"

    def __deepcopy__(self, memo: dict) -> "CudaTensor":
        """A copy that is a parameter if this is one."""
        if id(self) not in memo:
            made = self.detach().clone().requires_grad_(self.requires_grad)
            memo[id(self)] = torch.nn.Parameter(made, self.requires_grad) if hasattr(self, "_is_param") else made
        return memo[id(self)]

    @classmethod
    def __torch_dispatch__(cls, operation, _, args=(), kwargs=None):
        """Run an operation."""
        return _run(operation, args, kwargs or {})


class CudaGenerator(torch.Generator):
    """A generator that says it is on the pretended device."""

    device = property(lambda self: CUDA)


def _run(operation, args: tuple, kwargs: dict):
    leaves = tree_leaves((args, kwargs))
    tensors = [leaf for leaf in leaves if isinstance(leaf, torch.Tensor)]
    if not all(type(leaf) in (CudaTensor, torch.Tensor, torch.nn.Parameter) for leaf in tensors):
        return NotImplemented
    require_one_device(operation, args, kwargs, lambda each: isinstance(each, CudaTensor))
    ours = {id(leaf.inner): leaf for leaf in tensors if isinstance(leaf, CudaTensor)}
    if ours:
        require_products(operation, args)
    device = kwargs.get("device")
    pretended = bool(ours) if device is None else device.type in (CUDA.type, _BELOW.type)
    if pretended:
        OPERATIONS[str(operation)] += 1
    inside = tree_map_only(CudaTensor, lambda leaf: leaf.inner, (args, kwargs))
    if device is not None:
        inside[1]["device"] = torch.device("cpu")
    if operation is torch.ops.aten._to_copy.default and device is not None:
        found = inside[0][0].clone() if len(inside[1]) == 1 else operation(*inside[0], **inside[1])
    else:
        found = operation(*inside[0], **inside[1])

    def back(leaf):
        if not isinstance(leaf, torch.Tensor):
            return leaf
        if id(leaf) in ours:
            return ours[id(leaf)]
        return CudaTensor(leaf) if pretended and not any(leaf is each for each in tensors) else leaf

    if torch.Tag.inplace_view in operation.tags:  # such as squeeze_: the same to the size outside
        with no_dispatch():
            operation(*args, **kwargs)
    for each in ours.values():
        if each.inner.shape != each.shape:
            raise NotImplementedError(f"{operation} changes the shape of a tensor on the pretended device")
    return tree_map(back, found)


class _Operations(TorchDispatchMode):
    def __torch_dispatch__(self, operation, _, args=(), kwargs=None):
        return _run(operation, args, kwargs or {})


class _Names(torch.overrides.TorchFunctionMode):
    """Calls that name the device cuda reach the pretended one."""

    def __torch_function__(self, function, _, args=(), kwargs=None):
        kwargs = kwargs or {}
        if function is torch.device:
            return function(*args, **kwargs)
        if function is torch.Tensor.cuda:
            return args[0].to(_BELOW)
        leaves, form = tree_flatten((args, kwargs))
        leaves = [_below(leaf) for leaf in leaves]
        there = any(isinstance(leaf, CudaTensor) or leaf is _BELOW for leaf in leaves)
        for leaf in leaves:
            if isinstance(leaf, torch.Generator) and isinstance(leaf, CudaGenerator) != there:
                found, wanted = ("cpu", "cuda") if there else ("cuda", "cpu")
                raise RuntimeError(f"Expected a {wanted!r} device type for generator but found {found!r}")
        args, kwargs = tree_unflatten(leaves, form)
        return function(*args, **kwargs)


def _below(value):
    """The pretended device in the place of cuda; anything else is handed on."""
    if not isinstance(value, str | torch.device) or not re.fullmatch(r"cuda(:\d+)?", str(value)):
        return value
    if torch.device(value).index not in (None, 0):
        raise RuntimeError(
            "CUDA error: invalid device ordinal\nGPU device may be out of range, do you have enough GPUs?"
        )
    return _BELOW


_GUARD = backends._DummyDeviceGuard()
_HOOK = backends._DummyPrivateUse1Hook()


@contextlib.contextmanager
def pretended_cuda() -> Iterator[collections.Counter]:
    """Within the block there is one CUDA device. The value counts the operations on it by name."""
    OPERATIONS.clear()
    torch._C._acc.register_python_privateuseone_hook(_HOOK)
    torch._C._acc.register_python_privateuseone_device_guard(_GUARD)
    lifted = torch._C._only_lift_cpu_tensors()
    answers = {"is_available": True, "device_count": 1, "current_device": 0, "synchronize": None, "_lazy_init": None}
    with contextlib.ExitStack() as stack:
        for name, answer in answers.items():
            stack.enter_context(patch.object(torch.cuda, name, lambda *_, answer=answer: answer))
        module = types.SimpleNamespace(_lazy_init=lambda: None, current_device=lambda: 0)
        # Not patch.dict, which would also forget the modules that are imported within the block.
        stack.callback(sys.modules.pop, f"torch.{_BELOW.type}", None)
        sys.modules[f"torch.{_BELOW.type}"] = module
        torch._C._set_only_lift_cpu_tensors(True)
        stack.callback(torch._C._set_only_lift_cpu_tensors, lifted)
        stack.enter_context(_Operations())
        stack.enter_context(_Names())
        yield OPERATIONS
