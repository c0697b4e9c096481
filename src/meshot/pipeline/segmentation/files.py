"""The training of the segmentation network, from a configuration to files."""

import os
from collections.abc import Sequence
from pathlib import Path

import torch
from tqdm import tqdm

from meshot.model import require_small, write_weights
from meshot.pipeline.segmentation.data import read_examples
from meshot.pipeline.segmentation.settings import read_segmentation_config
from meshot.pipeline.segmentation.training import train_segmentation
from meshot.pipeline.training_files import (
    STATE_FOLDER,
    WEIGHTS,
    run_watched_training,
    shown_command,
    whole_record,
    write_record,
)
from meshot.provenance import provenance
from meshot.train import Training

#: What the files of the network are called.
NAME = "segmentation"


def run_segmentation_training(
    config_path: str | os.PathLike,
    cohorts: Sequence[str | os.PathLike],
    folder: str | os.PathLike,
    changes: Sequence[str] = (),
    device: torch.device | None = None,
) -> Training:
    """Train on the cohorts as the configuration says, with a progress bar, and write what came of it.

    Parameters
    ----------
    config_path : path
        A YAML file, or the name of one that comes with the package, such as "small".
    cohorts : sequence of path
    folder : path
        For ``segmentation.safetensors``, its record ``segmentation.json``, its log ``segmentation.log.jsonl`` and the
        picture of the log ``segmentation.png``; ``state/`` is what a stopped training goes on from.
    changes : sequence of str
        Such as ``training.precision=bfloat16``, in place of what the configuration says.
    device : torch.device, optional
        The accelerator if there is one, else the processor, if left out.

    Raises
    ------
    ValueError
        If the configuration, a cohort or the folder will not do, or the network is too large to be kept.
    """
    folder, config, made = Path(folder), read_segmentation_config(config_path, changes), provenance()
    require_small(config.new_network())
    training, validation = (
        read_examples(cohorts, split, config.training.reduction, lambda found, s=split: tqdm(found, desc=f"read {s}"))
        for split in ("train", "validation")
    )
    found = run_watched_training(
        folder,
        made,
        lambda report: train_segmentation(config, training, validation, folder / STATE_FOLDER, report, device),
    )
    command = shown_command("train-segmentation", config_path, cohorts, folder, changes, device=device)
    names = [Path(cohort).absolute().name for cohort in cohorts]
    record = whole_record(folder, config.as_dict(), found.results(), command, names)
    write_weights(folder / f"{NAME}{WEIGHTS}", found.network, record)
    write_record(folder, NAME, record, found.log)
    return found
