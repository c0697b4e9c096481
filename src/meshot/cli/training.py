"""What the commands that train a network share: their arguments, and how they run."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:  # for annotations only: help must come at once
    import torch

Trained = TypeVar("Trained")


def add_training_arguments(command: argparse.ArgumentParser, change: str) -> None:
    """Configuration, cohorts, output, changes (``change`` is an example), threads and device."""
    command.add_argument(
        "config", type=Path, help="the form of the network and how it is trained: a name, or a YAML file"
    )
    command.add_argument("--data", type=Path, nargs="+", required=True, metavar="COHORT", help="folders of cohorts")
    command.add_argument("-o", "--output", type=Path, required=True, metavar="FOLDER", help="for weights, log, picture")
    command.add_argument(
        "--set", nargs="+", default=[], metavar="GROUP.NAME=VALUE", dest="changes",
        help=f"in place of what the file says, such as {change}",
    )  # fmt: skip
    command.add_argument("--threads", type=int, help="of the processor; one repeats bit for bit (default: torch's)")
    command.add_argument("--device", help="cpu, cuda, ... (default: the accelerator if there is one, else cpu)")


def device_of(chosen: argparse.Namespace) -> "torch.device | None":
    """The device that was asked for.

    Raises
    ------
    ValueError
        If torch knows none of that name, or has none here.
    """
    import torch

    if chosen.device is None:
        return None
    try:
        torch.empty(0, device=chosen.device)
    except (RuntimeError, AssertionError) as error:
        raise ValueError(f"--device {chosen.device}: {error}; cpu is always there") from error
    return torch.device(chosen.device)


def run_training(chosen: argparse.Namespace, train: Callable[[], Trained]) -> Trained:
    """Train on as many threads as asked for.

    Raises
    ------
    ValueError
        If a number of threads will not do, or a loss or gradient was not finite.
    """
    import torch

    from meshot.errors import require_positive_integer

    if chosen.threads is not None:
        require_positive_integer(chosen.threads, "threads")
        torch.set_num_threads(chosen.threads)
    try:
        return train()
    except FloatingPointError as error:
        raise ValueError(str(error)) from error


def best_line(best_step: int, log: list[dict], cpu_seconds: float) -> str:
    """The best validation of a training, as one line."""
    best = next(line for line in log if line["step"] == best_step and "validation_loss" in line)
    numbers = ", ".join(f"{key} {value:.4g}" for key, value in best.items() if key not in ("step", "cpu_seconds"))
    return f"best after {best_step} steps: {numbers} on validation; {cpu_seconds:.0f} s of processor time"
