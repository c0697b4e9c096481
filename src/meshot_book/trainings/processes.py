"""Trainings one after another in this process, or side by side in several, each alone in its folder."""

import contextlib
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
import torch
from filelock import FileLock, Timeout
from tqdm import tqdm

from meshot.pipeline import STATE_FOLDER
from meshot.provenance import rounded

SECONDS_BETWEEN_LOOKS = 5.0
#: The file in the folder of a training with what its process printed.
OUTPUT = "output.txt"
#: A process keeps freed memory for the next step. glibc by default gives large blocks back to the system, and takes
#: them anew in every step: measured on a step of Vox2Cortex, some 7 % of its time.
_KEEP_MEMORY = {"MALLOC_MMAP_MAX_": "0", "MALLOC_TRIM_THRESHOLD_": str(2**34)}


class Busy(Exception):
    """Another process is training the same network."""


@contextlib.contextmanager
def alone(folder: Path, wait: bool = False) -> Iterator[None]:
    """Lock the folder of a training against other processes. The lock is released when the process ends.

    Parameters
    ----------
    folder : path
        It is created if it is missing.
    wait : bool
        Wait until no other process has locked it.

    Raises
    ------
    Busy
        If another process has locked it, and ``wait`` is false.
    """
    folder.mkdir(parents=True, exist_ok=True)
    try:
        lock = FileLock(folder / "lock").acquire(timeout=-1 if wait else 0)
    except Timeout as error:
        raise Busy(f"{folder.name} is being trained by another process") from error
    with lock:
        yield


def require_device(name: str) -> None:
    """Check that a device for trainings is there.

    Raises
    ------
    ValueError
        If it is a GPU, and PyTorch finds none.
    """
    if torch.device(name).type == "cuda" and not torch.cuda.is_available():
        raise ValueError(f"--device is {name}, and no such device is here: leave it out to train on the processor")


def train_in_turn(names: Sequence[str], train_one: Callable[[str], None]) -> list[str]:
    """Make one training after another in this process. Returns the names of those that failed.

    Parameters
    ----------
    names : sequence of str
    train_one : callable of a name
        A training has failed if this raises :class:`meshot_book.trainings.Busy`, FloatingPointError or ValueError. The
        next one then begins.
    """
    failed = []
    for i, name in enumerate(names):
        print(f"{name} ({i + 1} of {len(names)})", file=sys.stderr)
        try:
            train_one(name)
        except (Busy, FloatingPointError, ValueError) as error:
            print(error, file=sys.stderr)
            failed.append(name)
    return failed


def train_in_processes(folders: Mapping[str, Path], command: Sequence[str], n_jobs: int) -> list[str]:
    """Make several trainings at a time, each in a process with one thread. Returns the names of those that failed.

    The bar shows how far each has come. What a process prints is appended to ``output.txt`` in its folder. If this
    process ends, the others are stopped.

    Parameters
    ----------
    folders : mapping
        The folder of each training, by name, in the order in which they begin.
    command : sequence of str
        A command that makes one training when ``--only NAME`` is added.
    n_jobs : int
        Number of processes.
    """
    waiting, running, failed = list(folders), {}, []
    with tqdm(total=len(folders), desc="trainings", unit="training") as bar:
        try:
            while waiting or running:
                while waiting and len(running) < n_jobs:
                    name = waiting.pop(0)
                    running[name] = _started([*command, "--only", name], folders[name])
                time.sleep(SECONDS_BETWEEN_LOOKS)
                for name in [name for name, process in running.items() if process.poll() is not None]:
                    failed += [name] if running.pop(name).returncode else []
                    bar.update()
                bar.set_postfix_str("; ".join(f"{name}: step {steps_done(folders[name])}" for name in running))
        finally:
            for process in running.values():
                process.terminate()
    return failed


def _started(command: list[str], folder: Path) -> subprocess.Popen:
    folder.mkdir(parents=True, exist_ok=True)
    one_thread = dict.fromkeys(("OMP_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")
    with (folder / OUTPUT).open("a") as output:
        return subprocess.Popen(command, stdout=output, stderr=output, env=os.environ | one_thread | _KEEP_MEMORY)


# Logs of trainings: how far one has come, and a shorter log for a learning curve.

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


def curve(log: list[dict]) -> dict[str, list[float]]:
    """The distance at every check, and the mean loss of the steps since the previous check."""
    checks = [line for line in log if "validation_loss" in line]
    losses = {line["step"]: line["loss"] for line in log if "loss" in line}
    ends = [line["step"] for line in checks]
    means = [
        float(np.mean([losses[step] for step in losses if start < step <= end]))
        for start, end in zip([0, *ends], ends, strict=False)
    ]
    return {"step": ends, "assd_mm": [line["validation_loss"] for line in checks], "loss": means}
