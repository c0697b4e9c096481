"""Arguments and execution shared by the commands that train a network."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from meshot.cli.device import device_errors

Trained = TypeVar("Trained")


def add_training_arguments(command: argparse.ArgumentParser, change: str) -> None:
    """Add the arguments for configuration, cohorts, output, changed settings, threads and device.

    Parameters
    ----------
    command : argparse.ArgumentParser
    change : str
        An example of a changed setting, for the help text.
    """
    command.add_argument("config", type=Path, help="The settings of network and training: a name, or a YAML file.")
    command.add_argument(
        "--data", type=Path, nargs="+", required=True, metavar="COHORT", help="Train on the cohorts in these folders."
    )
    command.add_argument(
        "-o", "--output", type=Path, required=True, metavar="FOLDER",
        help="Write weights, log and a picture of the training to this folder.",
    )  # fmt: skip
    command.add_argument(
        "--set", nargs="+", default=[], metavar="GROUP.NAME=VALUE", dest="changes",
        help=f"Replace settings of the file, for example {change}.",
    )  # fmt: skip
    command.add_argument(
        "--threads", type=int, metavar="N",
        help="Use this many CPU threads; with 1, results are reproducible (default: as many as torch chooses).",
    )  # fmt: skip
    command.add_argument(
        "--device",
        metavar="NAME",
        help="Train on this device: cpu, cuda or cuda:1, for example (default: the GPU, if there is one).",
    )


def run_training(chosen: argparse.Namespace, train: Callable[[], Trained]) -> Trained:
    """Call ``train`` with the number of threads given by ``--threads``.

    Raises
    ------
    ValueError
        If the number of threads is not a positive integer, a loss or gradient was not finite, or the device failed.
    """
    import torch

    from meshot.errors import require_positive_integer

    if chosen.threads is not None:
        require_positive_integer(chosen.threads, "threads")
        torch.set_num_threads(chosen.threads)
    try:
        with device_errors():
            return train()
    except FloatingPointError as error:
        raise ValueError(str(error)) from error


def best_line(best_step: int, log: list[dict], cpu_seconds: float) -> str:
    """One line about the step with the best validation loss: the step, its metrics, and the processor time in s."""
    best = next(line for line in log if line["step"] == best_step and "validation_loss" in line)
    numbers = ", ".join(f"{key} {value:.4g}" for key, value in best.items() if key not in ("step", "cpu_seconds"))
    return f"best after {best_step} steps: {numbers} on validation; {cpu_seconds:.0f} s of processor time"
