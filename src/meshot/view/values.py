"""Validation of values at the vertices of surfaces, and their colour limits."""

from collections.abc import Mapping, Sequence

import numpy as np
import torch

from meshot.mesh import Mesh

COLOUR_MAP = "viridis"
Values = Sequence[float] | np.ndarray | torch.Tensor


def named(
    meshes: Mesh | Mapping[str, Mesh], values: Values | Mapping[str, Values] | None
) -> tuple[dict[str, Mesh], dict[str, np.ndarray]]:
    """Meshes and their values by name, with values as float64 arrays. A single mesh has the empty name.

    Raises
    ------
    ValueError
        If there is no mesh, or values have no mesh, another number than its vertices, or no finite entry.
    """
    if isinstance(meshes, Mesh):
        meshes, values = {"": meshes}, None if values is None else {"": values}
    if not meshes:
        raise ValueError("meshes is empty; at least one mesh is needed")
    if values is not None and not isinstance(values, Mapping):
        raise ValueError(f"values is a {type(values).__name__} for several meshes; a mapping by their names is needed")
    found = {}
    for name, numbers in (values or {}).items():
        if name not in meshes:
            raise ValueError(f"values are named {name!r}, which is none of the meshes: {', '.join(meshes)}")
        found[name] = _checked(numbers, name, len(meshes[name].vertices))
    return dict(meshes), found


def _checked(numbers: Values, name: str, n_vertices: int) -> np.ndarray:
    numbers = numbers.detach().cpu().numpy() if isinstance(numbers, torch.Tensor) else numbers
    array = np.asarray(numbers, dtype=np.float64)
    if array.shape != (n_vertices,):
        raise ValueError(f"values {name!r} has shape {array.shape}; ({n_vertices},) is needed, one for each vertex")
    if not np.isfinite(array).any():
        raise ValueError(f"values {name!r} has no finite entry; leave it out to draw the mesh plain")
    return array


def colour_limits(values: Mapping[str, np.ndarray], limits: tuple[float, float] | None) -> tuple[float, float]:
    """The values at the ends of the colour map: as given, or the range of all finite values.

    Raises
    ------
    ValueError
        If the limits are not two increasing, finite numbers.
    """
    if limits is not None:
        if not (np.isfinite(limits).all() and limits[0] < limits[1]):
            raise ValueError(f"limits are {limits!r}; two finite, increasing numbers are needed")
        return float(limits[0]), float(limits[1])
    if not values:
        return 0.0, 1.0
    every = np.concatenate(list(values.values()))
    low, high = float(np.min(every[np.isfinite(every)])), float(np.max(every[np.isfinite(every)]))
    # If all values are equal, the colour bar still needs a positive length.
    return (low, high) if low < high else (low - 0.5, high + 0.5)


def pointed_ends(values: Mapping[str, np.ndarray], limits: tuple[float, float]) -> str:
    """Which ends of the colour bar have values beyond them: "neither", "min", "max" or "both"."""
    every = np.concatenate(list(values.values()))
    below, above = bool((every < limits[0]).any()), bool((every > limits[1]).any())
    return {(False, False): "neither", (True, False): "min", (False, True): "max", (True, True): "both"}[below, above]


def bar_label(label: str, unit: str) -> str:
    """The label of a colour bar: the quantity, and its unit in parentheses."""
    return f"{label} ({unit})" if label and unit else label or unit
