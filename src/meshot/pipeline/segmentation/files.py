"""Training of the segmentation network from a configuration, with output files."""

import dataclasses
import os
from collections.abc import Sequence
from pathlib import Path

import torch
from tqdm import tqdm

from meshot.model import SegmentationNetwork, network_digest, read_weights, require_small, write_weights
from meshot.pipeline.segmentation.data import read_examples
from meshot.pipeline.segmentation.settings import read_segmentation_config
from meshot.pipeline.segmentation.training import first_network, train_segmentation
from meshot.pipeline.splits import placement_of
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
from meshot.types import PLACEMENTS

#: The base name of the output files.
NAME = "segmentation"


def run_segmentation_training(
    config_path: str | os.PathLike,
    cohorts: Sequence[str | os.PathLike],
    folder: str | os.PathLike,
    changes: Sequence[str] = (),
    device: torch.device | None = None,
    start: str | os.PathLike | None = None,
) -> Training:
    """Train on the cohorts with a configuration, show a progress bar, and write the output files.

    Parameters
    ----------
    config_path : path
        A YAML file, or the name of a configuration in the package, such as "small".
    cohorts : sequence of path
    folder : path
        The folder for ``segmentation.safetensors``, its record ``segmentation.json``, its log
        ``segmentation.log.jsonl`` and the picture of the log ``segmentation.png``. A stopped training resumes from
        ``state/``.
    changes : sequence of str
        Settings that replace those of the configuration, such as ``training.precision=bfloat16``.
    device : torch.device, optional
        By default the GPU if there is one, else the CPU.
    start : path, optional
        The training starts from the weights in this file, to adapt a trained network to other scans. By default they
        are random. The record has their digest as ``start_sha256``.

    Raises
    ------
    ValueError
        If the configuration, a cohort, the folder or the file of ``start`` is invalid, its network has another
        architecture, or the network is too large to be stored.
    """
    folder, config, made = Path(folder), read_segmentation_config(config_path, changes), provenance()
    placement = placement_of(cohorts)
    if placement != PLACEMENTS[0]:
        config = dataclasses.replace(config, network=config.network | {"placement": placement})
    first = None if start is None else read_weights(start, SegmentationNetwork)[0]
    require_small(first_network(config, first))
    training, validation = (
        read_examples(cohorts, split, config.training.reduction, lambda found, s=split: tqdm(found, desc=f"read {s}"))
        for split in ("train", "validation")
    )
    found = run_watched_training(
        folder,
        made,
        lambda report: train_segmentation(config, training, validation, folder / STATE_FOLDER, report, device, first),
    )
    command = shown_command("train-segmentation", config_path, cohorts, folder, changes, device=device, start=start)
    names = [Path(cohort).absolute().name for cohort in cohorts]
    origin = {} if first is None else {"start_sha256": network_digest(first)}
    record = whole_record(folder, config.as_dict(), found.results() | origin, command, names)
    write_weights(folder / f"{NAME}{WEIGHTS}", found.network, record)
    write_record(folder, NAME, record, found.log)
    return found
