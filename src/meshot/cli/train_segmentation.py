"""``meshot train-segmentation CONFIG --data COHORT -o OUT``."""

import argparse
from pathlib import Path

from meshot.cli.device import device_of
from meshot.cli.note import NOTE, Commands, add_command
from meshot.cli.training import add_training_arguments, best_line, run_training
from meshot.files import printable_name


def add_to(commands: Commands) -> None:
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
        "--start", type=Path, metavar="FILE",
        help="Start from the weights in this file, to adapt a network to other scans (default: random weights).",
    )  # fmt: skip
    command.set_defaults(run=_run)


def _run(chosen: argparse.Namespace) -> None:
    # Imported here, so that other commands start quickly.
    from meshot.pipeline.segmentation import run_segmentation_training

    found = run_training(
        chosen,
        lambda: run_segmentation_training(
            chosen.config, chosen.data, chosen.output, chosen.changes, device_of(chosen), chosen.start
        ),
    )
    print(f"{best_line(found.best_step, found.log, found.cpu_seconds)}; weights in {printable_name(chosen.output)}")
