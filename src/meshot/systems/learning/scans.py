"""Scans as inputs of networks, and a description of the examples of a training."""

import hashlib
from collections.abc import Sequence

import numpy as np
import torch

from meshot.systems.examples import Example, ExampleSets, SurfaceKey
from meshot.train import data_record
from meshot.types import Float, Tensor
from meshot.volume import Volume


def scaled_image(image: Volume) -> Float[Tensor, "1 1 x y z"]:
    """An image as input of a network, with mean 0 and standard deviation 1, in float32.

    Gain and offset of the scanner do not matter.

    Raises
    ------
    ValueError
        If the image is constant.
    """
    data = image.data.astype(np.float32)
    mean, spread = float(data.mean(dtype=np.float64)), float(data.std(dtype=np.float64))
    if not spread > 0:
        raise ValueError(f"the image is {mean:.4g} everywhere; a scan is needed")
    return torch.from_numpy((data - np.float32(mean)) / np.float32(spread))[None, None]


def example_data(sets: ExampleSets, keys: Sequence[SurfaceKey]) -> dict:
    """The number of examples for training and validation, and the SHA-256 of their scans and true surfaces."""
    return data_record(sets.training, sets.validation, lambda part: _digest(part, keys))


def _digest(examples: Sequence[Example], keys: Sequence[SurfaceKey]) -> str:
    total = hashlib.sha256()
    for item in examples:
        total.update(item.name.encode() + item.scan.image.data.astype(np.float32).tobytes())
        for key in keys:
            mesh = item.targets[key]
            total.update(mesh.vertices.double().numpy().tobytes() + mesh.faces.numpy().tobytes())
    return total.hexdigest()
