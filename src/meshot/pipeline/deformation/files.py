"""The training of a deformation network, from a configuration to files."""

import os
from collections.abc import Sequence
from pathlib import Path

import torch
from tqdm import tqdm

from meshot.model import SegmentationNetwork, network_digest, read_weights, require_small
from meshot.pipeline.deformation.data import InitialSurfaces
from meshot.pipeline.deformation.settings import read_deformation_config
from meshot.pipeline.deformation.training import train_deformation
from meshot.pipeline.networks import SEGMENTATION, SHIPPED
from meshot.pipeline.training_files import STATE_FOLDER, run_watched_training, shown_command, write_trained
from meshot.provenance import provenance
from meshot.train import Training, chosen_device


def run_deformation_training(
    config_path: str | os.PathLike,
    cohorts: Sequence[str | os.PathLike],
    folder: str | os.PathLike,
    segmentation: str | os.PathLike,
    initial: str | os.PathLike,
    changes: Sequence[str] = (),
    device: torch.device | None = None,
) -> Training:
    """Train on the cohorts as the configuration says, with a progress bar, and write what came of it.

    Parameters
    ----------
    config_path : path
        Such as ``experiments/ddot/small.yaml``.
    cohorts : sequence of path
    folder : path
        See :func:`meshot.pipeline.training_files.write_trained`; ``state/`` is what a stopped training goes on from.
    segmentation : path
        Weights of the segmentation network, which makes the initial surfaces.
    initial : path
        Where these are kept: what is there already is not made again.
    changes : sequence of str
        Such as ``training.side=right``, in place of what the configuration says.
    device : torch.device, optional
        The accelerator if there is one, else the processor, if left out.

    Raises
    ------
    ValueError
        If the configuration, a cohort, the weights or the folder will not do, or the network is too large to be kept.
    """
    folder, config, made = Path(folder), read_deformation_config(config_path, changes), provenance()
    require_small(config.new_network())
    network, _ = read_weights(segmentation, SegmentationNetwork)
    surfaces, settings = InitialSurfaces(initial, network), config.training
    training, validation = (
        surfaces.examples(
            cohorts, split, settings.side, settings.n_faces, lambda found, s=split: tqdm(found, desc=f"initial, {s}")
        )
        for split in ("train", "validation")
    )
    found = run_watched_training(
        folder,
        made,
        lambda report: train_deformation(
            config, training, validation, folder / STATE_FOLDER, report, device or chosen_device()
        ),
    )
    own = None if Path(segmentation) == SHIPPED / SEGMENTATION else segmentation
    command = shown_command("train", config_path, cohorts, folder, changes, own, device)
    write_trained(
        folder, found, config.as_dict(), command, [Path(cohort).absolute().name for cohort in cohorts],
        {"segmentation_sha256": network_digest(network)},
    )  # fmt: skip
    return found
