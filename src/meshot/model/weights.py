"""Storage of a trained network as one safetensors file with its architecture and the record of its training."""

import hashlib
import json
import os
from typing import TypeVar

import safetensors
import safetensors.torch
from torch import nn

from meshot.errors import as_floating
from meshot.files import whole_file

LARGEST_BYTES = 10_000_000
Network = TypeVar("Network", bound=nn.Module)


def write_weights(path: str | os.PathLike, network: nn.Module, record: dict) -> None:
    """Write the weights of a network as float32, completely or not at all.

    Parameters
    ----------
    path : path
    network : module
        It must have a method ``config`` that returns the arguments of its class.
    record : dict
        JSON values: settings, seed, data, commit, versions, seconds. The architecture is added.

    Raises
    ------
    ValueError
        If the weights take more than 10 MB, or the record cannot be written as JSON.
    """
    require_small(network)
    tensors = {name: value.detach().cpu().float().contiguous() for name, value in network.state_dict().items()}
    try:
        text = json.dumps(record | {"network": network.config()}, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise ValueError(f"the record of the weights cannot be written as JSON ({error})") from error
    with whole_file(path) as temporary:
        safetensors.torch.save_file(tensors, temporary, metadata={type(network).__name__: text})


def halve_weights(source: str | os.PathLike, target: str | os.PathLike) -> None:
    """Write a copy of a file of weights as float16, which takes half the space. The record is kept.

    :func:`read_weights` reads it as float32. A weight above 6e-5 in magnitude changes by less than 0.05 %.

    Raises
    ------
    ValueError
        If the source is missing or truncated, or a weight is too large for float16 (65 504).
    """
    try:
        with safetensors.safe_open(source, framework="pt") as file:
            tensors, metadata = {name: file.get_tensor(name).half() for name in file.keys()}, file.metadata()  # noqa: SIM118
    except (OSError, safetensors.SafetensorError) as error:
        raise ValueError(f"{os.fspath(source)} is not a whole file of weights ({error}): train it again") from error
    for name, value in tensors.items():
        as_floating(value, f"{name} as float16")
    with whole_file(target) as temporary:
        safetensors.torch.save_file(tensors, temporary, metadata=metadata)


def require_small(network: nn.Module) -> None:
    """Check that the weights of a network are small enough to be stored. Meant to be called before the training.

    Raises
    ------
    ValueError
        If they take more than 10 MB as float32.
    """
    n_bytes = 4 * sum(value.numel() for value in network.state_dict().values())
    if n_bytes > LARGEST_BYTES:
        raise ValueError(
            f"the weights take {n_bytes / 1e6:.1f} MB; at most {LARGEST_BYTES / 1e6:.0f} MB are kept: take a network "
            "of less width or depth"
        )


def network_digest(network: nn.Module) -> str:
    """The SHA-256 of the weights of a network, in hexadecimal digits."""
    total = hashlib.sha256()
    for name, value in network.state_dict().items():
        total.update(name.encode() + value.detach().cpu().contiguous().numpy().tobytes())
    return total.hexdigest()


def read_weights(path: str | os.PathLike, kind: type[Network]) -> tuple[Network, dict]:
    """Read a network of a class, such as ``SegmentationNetwork`` (float32, in evaluation mode), and its record.

    Raises
    ------
    ValueError
        If the file is missing, truncated, or of another kind, or a weight is NaN or infinite.
    """
    try:
        with safetensors.safe_open(path, framework="pt") as file:
            record = json.loads((file.metadata() or {})[kind.__name__])
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 (not a dict)
        for name, value in tensors.items():
            as_floating(value, name)
        network = kind(**record["network"]).float()
        network.load_state_dict(tensors)
    except (OSError, safetensors.SafetensorError, KeyError, TypeError, RuntimeError, ValueError) as error:
        raise ValueError(
            f"{os.fspath(path)} does not hold the weights of a {kind.__name__} ({error}); train one with meshot train "
            "or meshot train-segmentation"
        ) from error
    return network.eval(), record
