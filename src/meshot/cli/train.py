"""``meshot train SYSTEM CONFIG --data COHORT -o OUT``."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from meshot.cli.common import COUNT, FILE, FOLDER, NOTE, Commands, add_command, device_errors, device_of, known_systems
from meshot.files import printable_name


def add_to(commands: Commands) -> None:
    """Add the commands ``train`` and ``train-segmentation`` to the parser."""
    command = add_command(
        commands,
        "train",
        "Train a system, such as flows that deform initial surfaces.",
        "The command trains a system on cohorts. If it was stopped, the same command resumes. With --threads 1 "
        f"--device cpu, the final weights are the same as without the stop. {NOTE}",
        """
        meshot train ddot small --data build/cohorts/oasis_like -o build/ddot_small
        meshot train ddot small --data build/cohorts/oasis_like -o build/right --set training.side=right
        """,
        "Configurations of a system have names such as tiny, small and paper. Use the result with meshot reconstruct "
        "--system SYSTEM --weights FOLDER.",
    )
    command.add_argument("system", help=f"The name of the system: {', '.join(known_systems())}.")
    add_training_arguments(command, "training.side=right training.seed=1")
    command.add_argument(
        "--segmentation",
        **FILE,
        help="Find the initial surfaces with the segmentation network of this file (default: that of the package).",
    )
    command.add_argument(
        "--initial",
        **FOLDER,
        default=Path("build/initial"),
        help="Store initial surfaces in this folder for later trainings (default: %(default)s).",
    )
    command.set_defaults(run=_run)
    _add_segmentation(commands)


def _run(chosen: argparse.Namespace) -> None:
    # Imported here, so that other commands start quickly.
    from meshot.pipeline import run_system_training, segmentation_weights

    what = (chosen.system, chosen.config, chosen.data, chosen.output)
    how = (segmentation_weights(chosen.segmentation), chosen.initial, chosen.changes)
    trained = run_training(chosen, lambda: run_system_training(*what, *how, device_of(chosen)))
    for name, part in trained.parts.items():
        results = part.record["results"]
        print(f"{name}: {best_line(results['best_step'], part.log, results['cpu_seconds'])}")
    print(f"weights in {printable_name(chosen.output)}")


# ``meshot train-segmentation CONFIG --data COHORT -o OUT``.


def _add_segmentation(commands: Commands) -> None:
    """Add the command ``train-segmentation`` and its arguments to the parser."""
    command = add_command(
        commands,
        "train-segmentation",
        "Train the network that finds white matter.",
        "The command trains the segmentation of left and right white matter on cohorts. If it was stopped, the same "
        "command resumes. With --threads 1 --device cpu, the final weights are the same as without the stop. " + NOTE,
        """
        meshot train-segmentation small --data build/cohorts/oasis_like -o build/segmentation
        meshot train-segmentation small --data my_cohort -o mine --start build/segmentation/segmentation.safetensors
        """,
        "Configurations in the package are tiny, small, people and paper.",
    )
    add_training_arguments(command, "training.precision=bfloat16")
    command.add_argument(
        "--start",
        **FILE,
        help="Start from the weights in this file, to adapt a network to other scans (default: random weights).",
    )
    command.set_defaults(run=_run_segmentation)


def _run_segmentation(chosen: argparse.Namespace) -> None:
    # Imported here, so that other commands start quickly.
    from meshot.pipeline import run_segmentation_training

    what = (chosen.config, chosen.data, chosen.output, chosen.changes)
    found = run_training(chosen, lambda: run_segmentation_training(*what, device_of(chosen), chosen.start))
    print(f"{best_line(found.best_step, found.log, found.cpu_seconds)}; weights in {printable_name(chosen.output)}")


# Arguments and execution shared by the commands that train a network.

Trained = TypeVar("Trained")


def add_training_arguments(command: argparse.ArgumentParser, change: str) -> None:
    """Add the arguments for configuration, cohorts, output, changed settings, threads and device."""
    command.add_argument("config", type=Path, help="The settings of network and training: a name, or a YAML file.")
    command.add_argument(
        "--data", type=Path, nargs="+", required=True, metavar="COHORT", help="Train on the cohorts in these folders."
    )
    command.add_argument(
        "-o",
        "--output",
        **FOLDER,
        required=True,
        help="Write weights, log and a picture of the training to this folder.",
    )
    command.add_argument(
        "--set",
        nargs="+",
        default=[],
        metavar="GROUP.NAME=VALUE",
        dest="changes",
        help=f"Replace settings of the file, for example {change}.",
    )
    command.add_argument(
        "--threads",
        **COUNT,
        help="Use this many CPU threads; with 1, results are reproducible (default: as many as torch chooses).",
    )
    command.add_argument(
        "--device",
        metavar="NAME",
        help="Train on this device: cpu, cuda or cuda:1, for example (default: the GPU, if there is one).",
    )


def run_training(chosen: argparse.Namespace, train: Callable[[], Trained]) -> Trained:
    """Call ``train`` with the number of threads given by ``--threads``."""
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
