"""Output files of a training: weights, record, log, and a picture of the log."""

import json
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeVar

import torch
from tqdm import tqdm

from meshot.files import naming_a_full_disk, printable_name
from meshot.provenance import provenance, write_results
from meshot.synth import Subject, read_recipe, scans
from meshot.train import Progress, TrainingLog, read_log
from meshot.types import PLACEMENTS, Placement
from meshot.view import write_training_figure

#: The suffixes of the output files of a trained network.
WEIGHTS, RECORD, LOG, PICTURE = ".safetensors", ".json", ".log.jsonl", ".png"
STATE_FOLDER, SESSIONS = "state", "sessions.jsonl"

Trained = TypeVar("Trained")


def run_watched_training(folder: Path, made: dict, train: Callable[[Progress], Trained]) -> Trained:
    """Run a training with a progress bar that shows the last loss and the last validation."""
    # ``made`` is the provenance at the start of the command, since files may change while it runs. It is appended to
    # ``sessions.jsonl`` in the folder when the first step has been taken.
    with tqdm(desc="train", unit="step") as bar:
        shown: dict[str, str] = {}

        def report(done: int, n_steps: int, line: dict) -> None:
            if not shown:
                with naming_a_full_disk(folder / SESSIONS), (folder / SESSIONS).open("a", encoding="utf-8") as file:
                    file.write(json.dumps(made) + "\n")
            bar.total = n_steps
            bar.update(done - bar.n)
            kept = ("loss", "validation_loss", "dice_left", "dice_right", "hausdorff90_mm")
            shown.update({key: f"{value:.4g}" for key, value in line.items() if key in kept})
            bar.set_postfix(shown, refresh="loss" not in line)

        return train(report)


def whole_record(folder: Path, config: dict, results: dict, command: str, cohorts: Sequence[str | os.PathLike]) -> dict:
    """The record of a trained network: settings, results, command, names of the cohorts and provenance."""
    # The provenance is that of the last session in which a step was taken. ``commits`` in the results lists those of
    # all sessions.
    sessions = read_log(folder / SESSIONS) if (folder / SESSIONS).is_file() else [provenance()]
    commits = list(dict.fromkeys(session["commit"] for session in sessions))
    names = [Path(cohort).absolute().name for cohort in cohorts]
    return config | {"results": results | {"commits": commits}, "command": command, "cohorts": names} | sessions[-1]


def write_record(folder: Path, name: str, record: dict, log: list[dict]) -> None:
    """Write the record of a trained network with its provenance, its log, and a picture of the log."""
    # The files in ``folder`` are ``NAME.json``, ``NAME.log.jsonl`` and ``NAME.png``.
    made = {key: record[key] for key in provenance() if key in record}
    config = {key: value for key, value in record.items() if key not in (*made, "results", "command", "cohorts")}
    results, data = record["results"], f"synthetic cohorts {', '.join(record['cohorts'])}"
    write_results(folder / f"{name}{RECORD}", results, config, record["command"], data, results["cpu_seconds"], made)
    TrainingLog(folder / f"{name}{LOG}", log)
    write_training_figure(folder / f"{name}{PICTURE}", log)


def shown_command(
    name: str,
    config: str | os.PathLike,
    cohorts: Sequence[str | os.PathLike],
    folder: str | os.PathLike,
    changes: Sequence[str],
    *,
    segmentation: str | os.PathLike | None = None,
    device: torch.device | None = None,
    start: str | os.PathLike | None = None,
) -> str:
    """The command that repeats a training with the current number of threads, without absolute paths."""

    def shown(path: str | os.PathLike) -> str:
        path = Path(path)
        return printable_name(path.name if path.is_absolute() else path.as_posix())

    words = ["meshot", name, shown(config), "--data", *map(shown, cohorts), "-o", shown(folder)]
    words += [] if segmentation is None else ["--segmentation", shown(segmentation)]
    words += [] if start is None else ["--start", shown(start)]
    words += ["--threads", str(torch.get_num_threads())]
    words += [] if device is None else ["--device", str(device)]
    return " ".join([*words, *(["--set", *changes] if changes else [])])


# The scans of one split of one or more cohorts, and their placement on the standard grid.


def scans_of(cohorts: Sequence[str | os.PathLike], split: str) -> list[Subject]:
    """All finished scans of a split, in the order of the cohorts."""
    found = [subject for cohort in cohorts for subject in scans(cohort, split)]
    if not found:
        raise ValueError(f"no scan of the split {split!r} in {', '.join(map(str, cohorts)) or 'no cohort'}: make one")
    return found


def placement_of(cohorts: Sequence[str | os.PathLike]) -> Placement:
    """What placed the scans of cohorts on the standard grid; without a recipe, the registration of grey values."""
    recipes = {str(cohort): Path(cohort) / "recipe.yaml" for cohort in cohorts}
    found = {name: read_recipe(path).standard if path.is_file() else PLACEMENTS[0] for name, path in recipes.items()}
    if len(set(found.values())) > 1:
        each = ", ".join(f"{name} by {placement}" for name, placement in found.items())
        raise ValueError(
            f"scans are placed differently: {each}; train on cohorts with one placement; "
            "meshot make-cohort --standard chooses it"
        )
    return next(iter(found.values()), PLACEMENTS[0])
