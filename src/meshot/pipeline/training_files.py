"""A training from a configuration to files: weights, their record, the log and its picture."""

import json
import os
from collections.abc import Callable, Sequence
from pathlib import Path

import torch
from tqdm import tqdm

from meshot.files import printable_name
from meshot.model import write_weights
from meshot.provenance import provenance, write_results
from meshot.train import Progress, Training, TrainingLog, read_log
from meshot.view import write_training_figure

WEIGHTS, RECORD, LOG, PICTURE = "weights.safetensors", "weights.json", "log.jsonl", "training.png"
STATE_FOLDER, SESSIONS = "state", "sessions.jsonl"


def run_watched_training(folder: Path, made: dict, train: Callable[[Progress], Training]) -> Training:
    """Run a training under a progress bar that shows the last loss and the last validation.

    ``made`` is the provenance when the command began, since files may change while it runs: with the first step that is
    taken it goes into ``sessions.jsonl`` of the folder.
    """
    with tqdm(desc="train", unit="step") as bar:
        shown: dict[str, str] = {}

        def report(done: int, n_steps: int, line: dict) -> None:
            if not shown:
                _note(folder / SESSIONS, made)
            bar.total = n_steps
            bar.update(done - bar.n)
            kept = ("loss", "validation_loss", "dice_left", "dice_right", "hausdorff90_mm")
            shown.update({key: f"{value:.4g}" for key, value in line.items() if key in kept})
            bar.set_postfix(shown, refresh="loss" not in line)

        return train(report)


def _note(path: Path, line: dict) -> None:
    with path.open("a", encoding="utf-8") as file:
        file.write(json.dumps(line) + "\n")


def write_trained(
    folder: Path, found: Training, config: dict, command: str, cohorts: Sequence[str], extra: dict | None = None
) -> None:
    """Write what came of a training.

    Into ``folder`` go ``weights.safetensors`` (the best network, with its record), ``weights.json`` (the record as
    results with provenance), ``log.jsonl`` and ``training.png``. The provenance is that of the last session in which a
    step was taken; ``commits`` names those of all.

    Parameters
    ----------
    folder : path
    found : Training
    config : dict
        All settings, as JSON.
    command : str
        What to type to do the same again.
    cohorts : sequence of str
        Their names.
    extra : dict, optional
        What else belongs to the record, such as the weights that it builds on.
    """
    sessions = read_log(folder / SESSIONS) if (folder / SESSIONS).is_file() else [provenance()]
    results = {
        "best_step": found.best_step,
        "n_steps": max(line["step"] for line in found.log),
        "cpu_seconds": round(found.cpu_seconds, 1),
        "n_weights": sum(p.numel() for p in found.network.parameters()),
        "validations": [line for line in found.log if "validation_loss" in line],
        "data": found.data,
        "commits": list(dict.fromkeys(session["commit"] for session in sessions)),
    } | (extra or {})
    record = config | {"results": results, "command": command, "cohorts": list(cohorts)} | sessions[-1]
    write_weights(folder / WEIGHTS, found.network, record)
    data = f"synthetic cohorts {', '.join(cohorts)}"
    write_results(folder / RECORD, results, config, command, data, found.cpu_seconds, sessions[-1])
    TrainingLog(folder / LOG, found.log)
    write_training_figure(folder / PICTURE, found.log)


def shown_command(
    name: str,
    config: str | os.PathLike,
    cohorts: Sequence[str | os.PathLike],
    folder: str | os.PathLike,
    changes: Sequence[str],
    segmentation: str | os.PathLike | None = None,
    device: torch.device | None = None,
) -> str:
    """What to type for a training on as many threads as now, as it may be written down."""
    words = ["meshot", name, _shown(config), "--data", *map(_shown, cohorts), "-o", _shown(folder)]
    words += [] if segmentation is None else ["--segmentation", _shown(segmentation)]
    words += ["--threads", str(torch.get_num_threads())]
    words += [] if device is None else ["--device", str(device)]
    return " ".join([*words, *(["--set", *changes] if changes else [])])


def _shown(path: str | os.PathLike) -> str:
    """A path as it may be written down: relative, without where this machine keeps its files."""
    path = Path(path)
    return printable_name(path.as_posix() if not path.is_absolute() else path.name)
