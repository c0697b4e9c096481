"""``meshot train SYSTEM CONFIG --data COHORT -o OUT``."""

import argparse
from pathlib import Path

from meshot.cli.note import NOTE, Commands
from meshot.cli.training import add_training_arguments, best_line, device_of, run_training
from meshot.files import printable_name


def add_to(commands: Commands) -> None:
    """Add the command ``train`` and its arguments to the parser."""
    command = commands.add_parser(
        "train",
        help="train a system, such as flows that deform initial surfaces",
        description="Train a system on cohorts. If stopped, run the same command to resume; with --threads 1 "
        f"--device cpu the final weights are then the same. {NOTE}",
        epilog="CONFIG is a YAML file, or the name of a configuration of the system, such as tiny, small or "
        "paper. Use the result with: meshot reconstruct --system SYSTEM --weights OUT.",
    )
    command.add_argument("system", help="name of the system; for an unknown name, all names are listed")
    add_training_arguments(command, "training.side=right training.seed=1")
    command.add_argument(
        "--segmentation", type=Path, metavar="FILE",
        help="weights of the network for the initial surfaces (default: those of the package)",
    )  # fmt: skip
    command.add_argument(
        "--initial", type=Path, default=Path("build/initial"), metavar="FOLDER",
        help="folder in which initial surfaces are stored for later trainings (default: %(default)s)",
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
