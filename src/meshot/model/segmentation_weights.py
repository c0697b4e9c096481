"""A trained segmentation network as one safetensors file that says what it is and where it comes from."""

import json
import os

import safetensors
import safetensors.torch

from meshot.files import whole_file
from meshot.model.segmentation import SegmentationNetwork

LARGEST_BYTES = 10_000_000
_KEY = "segmentation"


def write_segmentation_weights(path: str | os.PathLike, network: SegmentationNetwork, record: dict) -> None:
    """Write the weights, float32, whole or not at all.

    Parameters
    ----------
    path : path
    network : SegmentationNetwork
    record : dict
        JSON: settings, seed, data, commit, versions, seconds. The form of the network is added.

    Raises
    ------
    ValueError
        If the weights take more than 10 MB, or the record is not JSON.
    """
    tensors = {name: value.detach().cpu().contiguous() for name, value in network.state_dict().items()}
    n_bytes = sum(value.numel() * value.element_size() for value in tensors.values())
    if n_bytes > LARGEST_BYTES:
        raise ValueError(
            f"the weights take {n_bytes / 1e6:.1f} MB; at most {LARGEST_BYTES / 1e6:.0f} MB are kept: take a network "
            "of less width or depth"
        )
    try:
        text = json.dumps(record | {"network": network.config()}, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise ValueError(f"the record of the weights cannot be written as JSON ({error})") from error
    with whole_file(path) as temporary:
        safetensors.torch.save_file(tensors, temporary, metadata={_KEY: text})


def read_segmentation_weights(path: str | os.PathLike) -> tuple[SegmentationNetwork, dict]:
    """The network, ready to use, and its record.

    Raises
    ------
    ValueError
        If the file is missing, truncated, or holds something else.
    """
    try:
        with safetensors.safe_open(path, framework="pt") as file:
            record = json.loads((file.metadata() or {})[_KEY])
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 (not a dict)
        network = SegmentationNetwork(**record["network"])
        network.load_state_dict(tensors)
    except (OSError, safetensors.SafetensorError, KeyError, TypeError, RuntimeError, json.JSONDecodeError) as error:
        raise ValueError(
            f"{os.fspath(path)} does not hold the weights of a segmentation network ({error}); train one with "
            "meshot train-segmentation"
        ) from error
    return network.eval(), record
