"""``meshot train SYSTEM CONFIG --data COHORT -o OUT``."""

import argparse
from pathlib import Path

from meshot.cli.device import device_of
from meshot.cli.note import NOTE, Commands, add_command
from meshot.cli.training import add_training_arguments, best_line, run_training
from meshot.files import printable_name


def add_to(commands: Commands) -> None:
    """Add the command ``train`` and its arguments to the parser."""
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
    command.add_argument("system", help="The name of the system. An unknown name is answered by a list of all names.")
    add_training_arguments(command, "training.side=right training.seed=1")
    command.add_argument(
        "--segmentation", type=Path, metavar="FILE",
        help="Find the initial surfaces with the segmentation network of this file (default: that of the package).",
    )  # fmt: skip
    command.add_argument(
        "--initial", type=Path, default=Path("build/initial"), metavar="FOLDER",
        help="Store initial surfaces in this folder for later trainings (default: %(default)s).",
    )  # fmt: skip
    command.set_defaults(run=_run)


def _run(chosen: argparse.Namespace) -> None:
    # Imported here, so that other commands start quickly.
    from meshot.pipeline import run_system_training, segmentation_weights

    segmentation = segmentation_weights(chosen.segmentation)
    trained = run_training(
        chosen,
        lambda: run_system_training(
            chosen.system, chosen.config, chosen.data, chosen.output, segmentation, chosen.initial, chosen.changes,
            device_of(chosen),
        ),
    )  # fmt: skip
    for name, part in trained.parts.items():
        results = part.record["results"]
        print(f"{name}: {best_line(results['best_step'], part.log, results['cpu_seconds'])}")
    print(f"weights in {printable_name(chosen.output)}")
