"""Which operations of PyTorch take tensors of two devices: the rules of CUDA, for the pretended device.

The check of most operations is generated from ``native_functions.yaml``, which comes with PyTorch: all tensors, those
without dimensions included, are on one device, unless the entry says ``device_check: NoCheck``. The exceptions:

- element by element (``TensorIterator.cpp``, ``compute_types``): one input of the processor without dimensions;
- ``where`` (``TensorCompare.cpp``): any number of such inputs;
- indexing (``TensorAdvancedIndexing.cpp``, ``IndexingUtils.h``): indices of the processor into a tensor of the device,
  not the reverse, and a value without dimensions;
- copies.

Matrix products of whole numbers are not implemented on a CUDA device.
"""

import functools
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import torch
import torchgen
from torch.utils._pytree import tree_leaves

_COPIES = ("aten::_to_copy", "aten::copy_", "aten::copy", "aten::_foreach_copy_")
_INDEXING = (
    "aten::index", "aten::index_put", "aten::index_put_", "aten::_index_put_impl_", "aten::_unsafe_index",
    "aten::_unsafe_index_put",
)  # fmt: skip
_PRODUCTS = (
    "aten::mm", "aten::mv", "aten::bmm", "aten::dot", "aten::addmm", "aten::addmv", "aten::addbmm", "aten::baddbmm",
)  # fmt: skip


def require_products(operation: torch._ops.OpOverload, args: Sequence) -> None:
    """Check that CUDA has the operation for the dtypes of the arguments.

    Raises
    ------
    RuntimeError
        With the words of PyTorch.
    """
    whole = [each.dtype for each in tree_leaves(args) if torch.is_tensor(each) and not _is_real(each)]
    if operation._schema.name in _PRODUCTS and whole:
        raise RuntimeError(f'"{operation._schema.name[6:]}_cuda" not implemented for {whole[0]}')


def _is_real(tensor: torch.Tensor) -> bool:
    return tensor.is_floating_point() or tensor.is_complex()


@functools.cache
def unchecked_operations() -> frozenset[str]:
    """The operations, with their overloads, whose devices are not compared before they begin."""
    text = (Path(torchgen.__file__).parent / "packaged/ATen/native/native_functions.yaml").read_text(encoding="utf-8")
    entries = re.findall(r"^- func: ([\w.]+)\((.*?)(?=^- func|\Z)", text, re.MULTILINE | re.DOTALL)
    return frozenset(f"aten::{name}" for name, entry in entries if "device_check: NoCheck" in entry)


def require_one_device(
    operation: torch._ops.OpOverload, args: Sequence, kwargs: Mapping, is_cuda: Callable[[torch.Tensor], bool]
) -> None:
    """Check that CUDA would accept the devices of the arguments.

    Raises
    ------
    RuntimeError
        With the words of PyTorch.
    """
    tensors = [leaf for leaf in tree_leaves((args, kwargs)) if isinstance(leaf, torch.Tensor)]
    on_cuda = [is_cuda(each) for each in tensors]
    if all(on_cuda) or not any(on_cuda) or operation._schema.name in _COPIES:
        return
    if operation._schema.name in _INDEXING:
        _require_indexing(args, is_cuda)
        return
    strangers = [each for each, there in zip(tensors, on_cuda) if not there]
    scalars = all(each.dim() == 0 for each in strangers) and not _changes(operation, args, strangers)
    most = len(tensors) if operation._schema.name == "aten::where" else 1
    if not scalars or len(strangers) > most or not _is_unchecked(operation):
        raise _mixed(operation)


def _mixed(operation: torch._ops.OpOverload) -> RuntimeError:
    return RuntimeError(
        f"Expected all tensors to be on the same device, but found at least two devices, cuda:0 and cpu! ({operation})"
    )


def _is_unchecked(operation: torch._ops.OpOverload) -> bool:
    name = operation._schema.name + (f".{operation._schema.overload_name}" if operation._schema.overload_name else "")
    return name in unchecked_operations()


def _changes(operation: torch._ops.OpOverload, args: Sequence, strangers: Sequence[torch.Tensor]) -> bool:
    """Whether a tensor of the processor would be written to."""
    written = [arg for arg, own in zip(args, operation._schema.arguments) if own.alias_info and own.alias_info.is_write]
    return any(arg is each for arg in written for each in strangers)


def _require_indexing(args: Sequence, is_cuda: Callable[[torch.Tensor], bool]) -> None:
    indexed, indices, values = args[0], tree_leaves(args[1]), [each for each in args[2:3] if torch.is_tensor(each)]
    if not is_cuda(indexed) and any(torch.is_tensor(each) and is_cuda(each) for each in indices):
        raise RuntimeError("indices should be either on cpu or on the same device as the indexed tensor (cpu)")
    for each in values:
        if is_cuda(each) != is_cuda(indexed) and (is_cuda(each) or each.dim() > 0):
            raise RuntimeError(
                "Expected all tensors to be on the same device, but found at least two devices, cuda:0 and cpu! (index)"
            )
