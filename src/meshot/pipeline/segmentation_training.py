"""Training the segmentation network: Adam on overlap and cross-entropy, resumable, with validation."""

import contextlib
import dataclasses
import os
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import torch

from meshot.model.segmentation import SegmentationNetwork
from meshot.model.segmentation_loss import segmentation_loss
from meshot.pipeline.segmentation_checkpoint import TrainingLog, TrainingState, read_training, write_training
from meshot.pipeline.segmentation_data import Example, augmented, digest
from meshot.pipeline.segmentation_settings import SegmentationConfig, SegmentationSettings
from meshot.types import Float, Tensor
from meshot.volume.tissue import dice

STATE, LOG = "training.safetensors", "log.jsonl"
_ORDER, _AUGMENTATION = 0, 1  # streams of randomness


@dataclasses.dataclass(frozen=True, eq=False)
class SegmentationTraining:
    """A trained network and how it came about.

    Parameters
    ----------
    network : SegmentationNetwork
        In its best state: that of the validation with the lowest loss.
    best_step : int
        Steps before that validation.
    log : list of dict
        ``step``, ``loss`` and ``learning_rate`` of every step; ``step``, ``validation_loss``, ``dice_left``,
        ``dice_right`` and ``cpu_seconds`` of every validation.
    cpu_seconds : float
        Of this process and of those before it that were stopped.
    data : dict
        How many examples for training and validation, and the SHA-256 of each set.
    """

    network: SegmentationNetwork
    best_step: int
    log: list[dict]
    cpu_seconds: float
    data: dict


def chosen_device() -> torch.device:
    """The accelerator if there is one, else the processor."""
    return torch.device("cuda" if torch.cuda.is_available() else "cpu")


def train_segmentation(
    config: SegmentationConfig,
    training: Sequence[Example],
    validation: Sequence[Example],
    folder: str | os.PathLike | None = None,
    report: Callable[[int, int, dict], None] | None = None,
    device: torch.device | None = None,
) -> SegmentationTraining:
    """Train a network from its first weights, or go on where a stopped training was.

    Parameters
    ----------
    config : SegmentationConfig
    training, validation : sequence of Example
        All on grids of one size.
    folder : path, optional
        Where the state is saved (``training.safetensors``) and the log is kept (``log.jsonl``). If a state is there
        already, training goes on from it, and on one thread ends with the same weights as if it had never stopped.
    report : callable of (steps done, steps in all, line of the log), optional
    device : torch.device, optional
        :func:`meshot.pipeline.segmentation_training.chosen_device` if left out.

    Raises
    ------
    ValueError
        If there are no examples, their grids differ, or the folder holds a training of something else.
    FloatingPointError
        If the loss or a gradient is not finite; it names the step and the scans.
    """
    _require_examples(training, validation)
    settings, device = config.training, device or chosen_device()
    network = config.new_network().to(device)
    state = TrainingState(network, torch.optim.Adam(network.parameters(), lr=settings.learning_rate))
    data = {
        name: {"n_scans": len(part), "sha256": digest(part)}
        for name, part in (("training", training), ("validation", validation))
    }
    made_with = config.as_dict() | {"data": data}
    saved = None if folder is None else Path(folder) / STATE
    if saved is not None and saved.exists():
        read_training(saved, state, made_with)
    log = TrainingLog(None if folder is None else Path(folder) / LOG, state.lines)
    per_epoch = -(-len(training) // settings.batch_size)
    n_steps, clock = settings.n_epochs * per_epoch, time.process_time()

    def note(line: dict) -> None:
        state.lines.append(line)
        log.add(line)
        if report is not None:
            report(state.step, n_steps, line)

    while state.step < n_steps and not _out_of_patience(state, settings):
        note(_step(state, training, settings, n_steps, device))
        state.seconds, clock = state.seconds + time.process_time() - clock, time.process_time()
        if state.step % (per_epoch * settings.validate_every) == 0 or state.step == n_steps:
            note(_validate(state, validation, settings, device))
        done = state.step == n_steps or _out_of_patience(state, settings)
        if saved is not None and (done or state.step % settings.save_every == 0):
            write_training(saved, state, made_with)
    network.load_state_dict(state.best)
    return SegmentationTraining(network.cpu(), state.best_step, state.lines, state.seconds, data)


def _require_examples(training: Sequence[Example], validation: Sequence[Example]) -> None:
    shapes = {item.image.shape for item in (*training, *validation)}
    if not training or not validation or len(shapes) != 1:
        raise ValueError(
            f"{len(training)} examples for training and {len(validation)} for validation came, on grids "
            f"{sorted(shapes)}; at least one of each is needed, all on one grid"
        )


def _out_of_patience(state: TrainingState, settings: SegmentationSettings) -> bool:
    fruitless = sum("validation_loss" in line and line["step"] > state.best_step for line in state.lines)
    return settings.patience is not None and fruitless >= settings.patience


def _batch(
    step: int, training: Sequence[Example], settings: SegmentationSettings
) -> tuple[list[str], Float[Tensor, "b 1 x y z"], Float[Tensor, "b 2 x y z"]]:
    """Names, images and fractions of one step: every epoch goes through all examples in a new order."""
    per_epoch = -(-len(training) // settings.batch_size)
    epoch, place = divmod(step, per_epoch)
    order = np.random.default_rng([settings.seed, _ORDER, epoch]).permutation(len(training))
    chosen = [training[i] for i in order[place * settings.batch_size : (place + 1) * settings.batch_size]]
    random = np.random.default_rng([settings.seed, _AUGMENTATION, step])
    pairs = [
        augmented(*item.tensors(settings.soft_labels), random, settings.flip, settings.shift, settings.intensity)
        for item in chosen
    ]
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


def _step(
    state: TrainingState,
    training: Sequence[Example],
    settings: SegmentationSettings,
    n_steps: int,
    device: torch.device,
) -> dict:
    step = state.step
    names, image, fractions = _batch(step, training, settings)
    state.optimiser.zero_grad(set_to_none=True)
    loss, _ = _loss(state.network, image.to(device), fractions.to(device), settings)
    loss.backward()
    total = sum(parameter.grad.square().sum() for parameter in state.network.parameters())
    for name, value in (("loss", loss), ("gradient", total)):
        if not bool(torch.isfinite(value)):
            raise FloatingPointError(
                f"the {name} of step {step} ({', '.join(names)}) is not finite; lower the learning rate, or look at "
                "those scans. The last saved state is whole"
            )
    rate = settings.learning_rate_at(step, n_steps)
    for group in state.optimiser.param_groups:
        group["lr"] = rate
    state.optimiser.step()
    state.step = step + 1
    return {"step": state.step, "loss": float(loss.detach()), "learning_rate": rate}


@torch.no_grad()
def _validate(
    state: TrainingState, validation: Sequence[Example], settings: SegmentationSettings, device: torch.device
) -> dict:
    """Mean loss and Dice over the scans of the validation; the network is kept if the loss is the lowest so far."""
    losses, overlaps = [], []
    for item in validation:
        image, fractions = (part[None].to(device) for part in item.tensors(settings.soft_labels))
        loss, logits = _loss(state.network, image, fractions, settings)
        found = (torch.softmax(logits, dim=1)[0, 1:] > 0.5).cpu().numpy()
        truth = (fractions[0] > 0.5).cpu().numpy()
        losses.append(float(loss))
        overlaps.append([dice(a, b) for a, b in zip(found, truth)])
    value, (left, right) = float(np.mean(losses)), np.mean(overlaps, axis=0).tolist()
    if value < state.best_loss:
        state.keep_as_best(value)
    return {
        "step": state.step, "validation_loss": value, "dice_left": left, "dice_right": right,
        "cpu_seconds": round(state.seconds, 1),
    }  # fmt: skip
