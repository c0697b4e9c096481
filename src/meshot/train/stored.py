"""Reading of the state of a training from a safetensors file, with checks before anything is changed."""

import json
import os

import safetensors
import torch
from torch import nn

from meshot.types import Tensor

#: The tensors that Adam stores for every parameter. All but the step have the shape of the parameter.
_MOMENTS = {"step", "exp_avg", "exp_avg_sq"}


def read_tensors(path: str | os.PathLike, name: str, entry: str) -> tuple[dict, dict[str, Tensor]]:
    """The JSON header ``name`` of a safetensors file, in which ``entry`` is a mapping, and its tensors.

    Raises
    ------
    ValueError
        If the file is missing, is not a complete safetensors file, or has another header.
    """
    try:
        with safetensors.safe_open(path, framework="pt") as file:
            header = json.loads((file.metadata() or {})[name])
            tensors = {key: file.get_tensor(key) for key in file.keys()}  # noqa: SIM118 (not a dict)
        if not isinstance(header, dict) or not isinstance(header[entry], dict):
            raise ValueError(f"its header holds no {entry}")
    except (OSError, safetensors.SafetensorError, KeyError, ValueError, RecursionError) as error:
        raise ValueError(str(error)) from error
    return header, tensors


def stored_parts(
    tensors: dict[str, Tensor], module: nn.Module, optimiser: torch.optim.Adam
) -> tuple[dict[str, Tensor], dict[str, Tensor], dict[int, dict[str, Tensor]]]:
    """The weights of a module, the best weights, and the moments of the optimiser by index of the parameter.

    Parameters
    ----------
    tensors : dict
        Named ``network/...``, ``best/...`` and ``adam/INDEX/...``.
    module : nn.Module
    optimiser : torch.optim.Adam
        The optimiser of the parameters of the module.

    Raises
    ------
    ValueError
        If a tensor is missing or unknown, or has another shape or dtype than required.
    """
    parts: dict[str, dict[str, Tensor]] = {part: {} for part in ("network", "best", "adam")}
    for name, value in tensors.items():
        part, _, key = name.partition("/")
        if part not in parts:
            raise ValueError(f"{name} is unknown")
        parts[part][key] = value
    for part in ("network", "best"):
        if _forms(parts[part]) != _forms(module.state_dict()):
            raise ValueError(f"{part} has other tensors")
    return parts["network"], parts["best"], _moments(parts["adam"], optimiser)


def _moments(stored: dict[str, Tensor], optimiser: torch.optim.Adam) -> dict[int, dict[str, Tensor]]:
    parameters = [parameter for group in optimiser.param_groups for parameter in group["params"]]
    found: dict[int, dict[str, Tensor]] = {}
    for key, value in stored.items():
        index, _, name = key.partition("/")
        if not index.isdecimal() or int(index) >= len(parameters) or name not in _MOMENTS:
            raise ValueError(f"adam/{key} is unknown")
        if value.shape != (() if name == "step" else parameters[int(index)].shape):
            raise ValueError(f"adam/{key} has the shape {tuple(value.shape)}")
        found.setdefault(int(index), {})[name] = value
    if any(set(moments) != _MOMENTS for moments in found.values()):
        raise ValueError("moments of the optimiser are missing")
    return found


def _forms(tensors: dict[str, Tensor]) -> dict[str, tuple]:
    return {name: (tuple(value.shape), value.dtype) for name, value in tensors.items()}
