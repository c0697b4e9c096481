"""Training of a system from its name and a configuration, with output files."""

import os
from collections.abc import Sequence
from pathlib import Path

import torch
from tqdm import tqdm

from meshot.model import SegmentationNetwork, network_digest, read_weights
from meshot.pipeline.examples import InitialSurfaces
from meshot.pipeline.networks import SEGMENTATION, require_placement
from meshot.pipeline.splits import placement_of
from meshot.pipeline.training_files import (
    STATE_FOLDER,
    run_watched_training,
    shown_command,
    whole_record,
    write_record,
)
from meshot.provenance import provenance
from meshot.systems import SHIPPED, ExampleSets, Part, SurfaceSystem, get_system, read_settings
from meshot.types import PLACEMENTS


def run_system_training(
    name: str,
    config: str | os.PathLike,
    cohorts: Sequence[str | os.PathLike],
    folder: str | os.PathLike,
    segmentation: str | os.PathLike,
    initial: str | os.PathLike,
    changes: Sequence[str] = (),
    device: torch.device | None = None,
) -> SurfaceSystem:
    """Train a system on cohorts, show a progress bar, and write the output files.

    For every part of the system, ``folder`` receives the weights ``PART.safetensors``, the record ``PART.json``, the
    log ``PART.log.jsonl`` and its picture ``PART.png``. A stopped training resumes from ``state/``.

    Parameters
    ----------
    name : str
        The name of the system: see :func:`meshot.systems.get_system`.
    config : path or str
        A YAML file, or the name of a configuration of the system.
    cohorts : sequence of path
    folder : path
    segmentation : path
        Weights of the segmentation network, which makes the initial surfaces.
    initial : path
        The folder of initial surfaces. Those that exist already are not computed again.
    changes : sequence of str
        Settings that replace those of the configuration, such as ``training.seed=1``.
    device : torch.device, optional
        By default the GPU if there is one, else the CPU.

    Raises
    ------
    ValueError
        If the system is unknown, or the configuration, a cohort, the weights or the folder is invalid.
    """
    folder, made, kind = Path(folder), provenance(), get_system(name)
    settings = read_settings(kind, config, changes)
    network, _ = read_weights(segmentation, SegmentationNetwork)
    placement = placement_of(cohorts)
    require_placement(network, placement, " and ".join(map(str, cohorts)))
    surfaces = InitialSurfaces(initial, network)
    sets = (
        surfaces.examples(
            cohorts, split, kind.surfaces_of(settings), kind.needs, lambda found, s=split: tqdm(found, desc=s)
        )
        for split in ("train", "validation")
    )
    examples = ExampleSets(*sets)
    found = run_watched_training(
        folder, made, lambda report: kind.train(examples, settings, folder / STATE_FOLDER, report, device)
    )
    own = None if Path(segmentation) == SHIPPED / SEGMENTATION else segmentation
    command = shown_command(f"train {name}", config, cohorts, folder, changes, segmentation=own, device=device)
    extra = {"segmentation_sha256": network_digest(network)} if kind.needs else {}
    extra |= {} if placement == PLACEMENTS[0] else {"placement": placement}
    trained = kind({part: _recorded(each, folder, command, cohorts, extra) for part, each in found.parts.items()})
    trained.save(folder)
    for part, each in trained.parts.items():
        write_record(folder, part, each.record, each.log)
    return trained


def _recorded(part: Part, folder: Path, command: str, cohorts: Sequence[str | os.PathLike], extra: dict) -> Part:
    settings = {key: value for key, value in part.record.items() if key != "results"}
    names = [Path(cohort).absolute().name for cohort in cohorts]
    record = whole_record(folder, settings, part.record["results"] | extra, command, names)
    return Part(part.network, record, part.log)
