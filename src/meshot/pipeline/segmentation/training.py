"""Training of the segmentation network with Adam on overlap and cross-entropy, with validation and resumption."""

import contextlib
import copy
import os
from collections.abc import Sequence

import numpy as np
import torch

from meshot.model import SegmentationNetwork, network_digest, segmentation_loss
from meshot.pipeline.segmentation.augmentation import augmented
from meshot.pipeline.segmentation.data import Example, digest
from meshot.pipeline.segmentation.settings import SegmentationConfig, SegmentationSettings
from meshot.train import (
    Progress,
    Task,
    Training,
    chosen_device,
    data_record,
    examples_of_step,
    require_examples,
    train_network,
)
from meshot.types import PLACEMENTS, Float, Tensor
from meshot.volume import dice

_AUGMENTATION = 1  # random number stream; the order of the examples has stream 0


def train_segmentation(
    config: SegmentationConfig,
    training: Sequence[Example],
    validation: Sequence[Example],
    folder: str | os.PathLike | None = None,
    progress: Progress | None = None,
    device: torch.device | None = None,
    start: SegmentationNetwork | None = None,
) -> Training:
    """Train a network from its initial weights, or resume a stopped training.

    Parameters
    ----------
    config : SegmentationConfig
    training, validation : sequence of Example
        All on grids of the same size.
    folder : path, optional
        The folder for the state (``training.safetensors``) and the log (``log.jsonl``). If it contains a state, the
        training resumes from it. On one thread, the final weights are the same as without the interruption.
    progress : callable of (steps done, number of steps, line of the log), optional
    device : torch.device, optional
        By default the GPU if there is one, else the CPU.
    start : SegmentationNetwork, optional
        The training starts from the weights of this network, which stays as it is. By default they are random.

    Raises
    ------
    ValueError
        If there are no examples, their grids differ, ``start`` has another architecture than the configuration, or the
        folder contains a different training.
    FloatingPointError
        If the loss or a gradient is not finite. The message names the step and the scans.
    """
    require_examples(training, validation)
    _require_one_grid(training, validation)
    settings, device = config.training, device or chosen_device()
    network = first_network(config, start).to(device)

    def loss_of(step: int) -> tuple[Tensor, str]:
        names, image, fractions = _batch(step, training, settings)
        return _loss(network, image.to(device), fractions.to(device), settings)[0], ", ".join(names)

    made_with = config.as_dict() | {"data": data_record(training, validation, digest)}
    made_with |= {} if start is None else {"start_sha256": network_digest(start)}
    return train_network(
        network, settings.plan(len(training)),
        Task(loss_of, lambda _: _validation(network, validation, settings, device)),
        made_with, folder, progress,
    )  # fmt: skip


def first_network(config: SegmentationConfig, start: SegmentationNetwork | None) -> SegmentationNetwork:
    """The network before the first step: untrained, or a copy of ``start``.

    Raises
    ------
    ValueError
        If ``start`` has another architecture than the configuration, or its training scans were placed otherwise.
    """
    network = config.new_network()
    if start is None:
        return network
    has, needed = ({"placement": PLACEMENTS[0]} | each.config() for each in (start, network))
    for name in needed:
        if has[name] != needed[name]:
            by_cohort = "cohorts that were made with that placement (meshot make-cohort --standard)"
            remedy = by_cohort if name == "placement" else f"--set network.{name}={has[name]}"
            raise ValueError(
                f"the network to start from has {name} {has[name]!r}, and this training has {needed[name]!r}: take "
                f"{remedy}, or start from another network"
            )
    return copy.deepcopy(start)


def _require_one_grid(training: Sequence[Example], validation: Sequence[Example]) -> None:
    shapes = {item.image.shape for item in (*training, *validation)}
    if len(shapes) != 1:
        raise ValueError(f"the examples are on grids {sorted(shapes)}; all must be on one grid: bring them to it")


def _batch(
    step: int, training: Sequence[Example], settings: SegmentationSettings
) -> tuple[list[str], Float[Tensor, "b 1 x y z"], Float[Tensor, "b 2 x y z"]]:
    """Names, images and fractions of one step."""
    chosen = [training[i] for i in examples_of_step(step, len(training), settings.seed, settings.batch_size)]
    generator = np.random.default_rng([settings.seed, _AUGMENTATION, step])
    changes = settings.augmentation()
    pairs = [augmented(*item.tensors(settings.soft_labels), generator, changes) for item in chosen]
    images, fractions = (torch.stack(part) for part in zip(*pairs))
    return [item.name for item in chosen], images, fractions


def _loss(
    network: SegmentationNetwork, image: Tensor, fractions: Tensor, settings: SegmentationSettings
) -> tuple[Tensor, Tensor]:
    short = settings.precision == "bfloat16"
    with torch.autocast(image.device.type, torch.bfloat16) if short else contextlib.nullcontext():
        logits = network(image)
    logits = logits.float()
    return segmentation_loss(logits, fractions, settings.dice_weight), logits


@torch.no_grad()
def _validation(
    network: SegmentationNetwork, validation: Sequence[Example], settings: SegmentationSettings, device: torch.device
) -> dict:
    """Mean loss and Dice over the validation scans."""
    losses, overlaps = [], []
    for item in validation:
        image, fractions = (part[None].to(device) for part in item.tensors(settings.soft_labels))
        loss, logits = _loss(network, image, fractions, settings)
        found = (torch.softmax(logits, dim=1)[0, 1:] > 0.5).cpu().numpy()
        truth = (fractions[0] > 0.5).cpu().numpy()
        losses.append(float(loss))
        overlaps.append([dice(a, b) for a, b in zip(found, truth)])
    left, right = np.mean(overlaps, axis=0).tolist()
    return {"validation_loss": float(np.mean(losses)), "dice_left": left, "dice_right": right}
