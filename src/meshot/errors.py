"""Checks of arguments. Each raises a ``ValueError`` that says what was received, what is needed and how to fix it."""

import math
from collections.abc import Iterable

import numpy as np
import torch

from meshot.types import Tensor


def as_floating(values: object, name: str) -> Tensor:
    """A finite floating-point tensor, from anything that ``torch.as_tensor`` accepts."""
    try:
        tensor = torch.as_tensor(values)
    except (TypeError, ValueError, RuntimeError) as error:
        raise ValueError(
            f"{name} cannot be made a tensor ({error}); pass an array of floating-point numbers"
        ) from error
    if not tensor.is_floating_point():
        remedy = "take its .real part" if tensor.is_complex() else "convert with .double() or .float()"
        array_remedy = "" if isinstance(values, Tensor) or tensor.is_complex() else ", an array with .astype(float)"
        raise ValueError(f"{name} has dtype {tensor.dtype}; floating point is needed: {remedy}{array_remedy}")
    require_finite(tensor, name)
    return tensor


def as_indices(values: object, name: str, n_items: int) -> Tensor:
    """An int64 tensor of indices in ``[0, n_items)``."""
    try:
        tensor = torch.as_tensor(values)
    except (TypeError, ValueError, RuntimeError) as error:
        raise ValueError(f"{name} cannot be made a tensor ({error}); pass an array of integers") from error
    if tensor.is_floating_point() or tensor.is_complex() or tensor.dtype == torch.bool:
        raise ValueError(f"{name} has dtype {tensor.dtype}; integers are needed: convert with .long()")
    tensor = tensor.to(torch.int64)
    if tensor.numel() and (int(tensor.min()) < 0 or int(tensor.max()) >= n_items):
        raise ValueError(
            f"{name} holds indices from {int(tensor.min())} to {int(tensor.max())}, but there are {n_items} vertices: "
            f"indices must lie in [0, {n_items - 1}] (files that count from 1 need a shift by one)"
        )
    return tensor


def require_shape(tensor: Tensor, name: str, columns: int | None) -> None:
    """Check that a tensor is a matrix with at least one row and, unless ``columns`` is None, that many columns."""
    wanted = f"(n, {columns if columns is not None else 'd'})"
    if tensor.ndim != 2 or (columns is not None and tensor.shape[1] != columns):
        raise ValueError(f"{name} has shape {tuple(tensor.shape)}; {wanted} is needed: one row per item")
    if tensor.shape[0] == 0 or tensor.shape[1] == 0:
        raise ValueError(f"{name} is empty (shape {tuple(tensor.shape)}); at least one row and one column are needed")


def as_points(values: object, name: str, columns: int | None = None) -> Tensor:
    """A matrix of finite floating-point numbers, one row per point; with that many columns, unless it is None."""
    points = as_floating(values, name)
    require_shape(points, name, columns)
    return points


def require_finite(tensor: Tensor, name: str) -> None:
    """Check that no entry is NaN or infinite."""
    bad = ~torch.isfinite(tensor.detach())
    if bool(bad.any()):
        first = tuple(int(i) for i in bad.nonzero()[0])
        raise ValueError(
            f"{name} has {int(bad.sum())} entries that are NaN or infinite, the first at index {first}: "
            "remove them, or look for the step that made them"
        )


def require_same_space(source: Tensor, target: Tensor) -> None:
    """Check that two point sets have the same dimension, dtype and device."""
    if source.shape[-1] != target.shape[-1]:
        raise ValueError(
            f"source lives in R^{source.shape[-1]} and target in R^{target.shape[-1]}; both must live in the "
            "same space: encode both meshes in the same way"
        )
    if source.dtype != target.dtype or source.device != target.device:
        raise ValueError(
            f"source is {source.dtype} on {source.device}, target {target.dtype} on {target.device}; both must agree: "
            "convert one with .to(...)"
        )


def require_positive_integer(value: object, name: str, most: int | None = None) -> int:
    """The value as a Python int, after checking that it is an integer (Python's or NumPy's) in [1, ``most``]."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 1:
        raise ValueError(f"{name} is {value!r}; an integer >= 1 is needed")
    if most is not None and value > most:
        raise ValueError(f"{name} is {value!r}; at most {most} is possible")
    return int(value)


def require_natural(value: object, name: str) -> None:
    """Check that a value is an integer >= 0."""
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise ValueError(f"{name} is {value!r}; an integer >= 0 is needed")


def require_positive(value: object, name: str, unit: str = "") -> None:
    """Check that a value is a finite number > 0. The message names the unit, if it is given."""
    try:
        positive = bool(0 < value < math.inf)
    except TypeError:
        positive = False
    if not positive:
        raise ValueError(f"{name} is {value!r}; a finite number > 0 is needed{unit and f', in {unit}'}")


def require_choice(value: object, name: str, known: Iterable) -> None:
    """Check that a value is one of the known names or numbers."""
    known = list(known)
    if value not in known:
        raise ValueError(f"{name} is {value!r}; one of {', '.join(map(str, known))} is needed")
