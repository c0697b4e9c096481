"""Logs of trainings: how far one has come, and a shorter log for a learning curve."""

from pathlib import Path

from meshot.pipeline import STATE_FOLDER
from meshot.provenance import rounded

CURVE_POINTS = 110


def steps_done(folder: Path) -> int:
    """The approximate number of steps of a training so far: the lines of its logs, of which a few are validations.

    Parameters
    ----------
    folder : path
        The folder of a training of a system, see :func:`meshot.pipeline.run_system_training`. The steps of all its
        networks are added.
    """
    return sum(path.read_bytes().count(b"\n") for path in (folder / STATE_FOLDER).glob("*/log.jsonl"))


def thinned(log: list[dict], n_points: int = CURVE_POINTS) -> list[dict]:
    """A log for a learning curve: all validations, and the mean loss over each of ``n_points`` intervals of steps."""
    steps = [line for line in log if "loss" in line]
    size = max(1, len(steps) // n_points)
    means = []
    for start in range(0, len(steps), size):
        part = steps[start : start + size]
        means.append(part[-1] | {"loss": sum(line["loss"] for line in part) / len(part)})
    checks = [line for line in log if "validation_loss" in line]
    # A validation is listed after the step that it follows.
    return rounded(sorted([*means, *checks], key=lambda line: (line["step"], "validation_loss" in line)))
