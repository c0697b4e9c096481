"""A training from a configuration to files: weights, their record, the log and its picture."""

import os
from collections.abc import Sequence
from pathlib import Path

from tqdm import tqdm

from meshot.figures.training import write_training_figure
from meshot.model.weights import write_weights
from meshot.pipeline.checkpoint import TrainingLog
from meshot.pipeline.segmentation_data import read_examples
from meshot.pipeline.segmentation_settings import read_segmentation_config
from meshot.pipeline.segmentation_training import train_segmentation
from meshot.pipeline.training import Training
from meshot.report.results import provenance, write_results

WEIGHTS, RECORD, LOG, PICTURE = "weights.safetensors", "weights.json", "log.jsonl", "training.png"
STATE_FOLDER = "state"


def trained_segmentation(
    config_path: str | os.PathLike, cohorts: Sequence[str | os.PathLike], folder: str | os.PathLike
) -> Training:
    """Train on the cohorts as the configuration says, with a progress bar, and write what came of it.

    Into ``folder`` go ``weights.safetensors`` (the best network, with its record), ``weights.json`` (the record as
    results with provenance), ``log.jsonl`` and ``training.png``; ``state/`` is what a stopped training goes on from.

    Parameters
    ----------
    config_path : path
        Such as ``experiments/segmentation/small.yaml``.
    cohorts : sequence of path
    folder : path

    Raises
    ------
    ValueError
        If the configuration, a cohort or the folder will not do.
    """
    folder, config = Path(folder), read_segmentation_config(config_path)
    names = [Path(cohort).name for cohort in cohorts]
    training, validation = (
        read_examples(cohorts, split, config.training.reduction, lambda found, s=split: tqdm(found, desc=f"read {s}"))
        for split in ("train", "validation")
    )
    with tqdm(desc="train", unit="step") as bar:

        def report(done: int, n_steps: int, line: dict) -> None:
            bar.total = n_steps
            bar.update(done - bar.n)
            shown = {k: f"{v:.4g}" for k, v in line.items() if k in ("loss", "dice_left", "dice_right")}
            bar.set_postfix(shown, refresh="loss" not in line)

        found = train_segmentation(config, training, validation, folder / STATE_FOLDER, report)
    words = (
        f"meshot train-segmentation {_shown(config_path)} --data {' '.join(map(_shown, cohorts))} -o {_shown(folder)}"
    )
    results = {
        "best_step": found.best_step,
        "n_steps": max(line["step"] for line in found.log),
        "cpu_seconds": round(found.cpu_seconds, 1),
        "n_weights": sum(p.numel() for p in found.network.parameters()),
        "validations": [line for line in found.log if "validation_loss" in line],
        "data": found.data,
    }
    record = config.as_dict() | {"results": results, "command": words, "cohorts": names} | provenance()
    write_weights(folder / WEIGHTS, found.network, record)
    data = f"synthetic cohorts {', '.join(names)}"
    write_results(folder / RECORD, results, config.as_dict(), words, data, found.cpu_seconds)
    TrainingLog(folder / LOG, found.log)
    write_training_figure(folder / PICTURE, found.log)
    return found


def _shown(path: str | os.PathLike) -> str:
    """A path as it may be written down: relative, without where this machine keeps its files."""
    path = Path(path)
    return path.as_posix() if not path.is_absolute() else path.name
