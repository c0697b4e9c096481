"""``meshot train-segmentation CONFIG --data COHORT -o OUT``."""

import argparse
from pathlib import Path

import torch

from meshot.cli.note import NOTE, Commands
from meshot.errors import require_positive_integer


def add_to(commands: Commands) -> None:
    """Let the command line know the command and its arguments."""
    command = commands.add_parser(
        "train-segmentation",
        help="train the network that finds white matter",
        description="Learn left and right white matter from cohorts; stopped, the same command goes on and ends with "
        f"the same weights. {NOTE}",
        epilog="Configurations: experiments/segmentation/tiny.yaml, small.yaml, paper.yaml.",
    )
    command.add_argument("config", type=Path, help="a YAML file: form of the network, and how it is trained")
    command.add_argument("--data", type=Path, nargs="+", required=True, metavar="COHORT", help="folders of cohorts")
    command.add_argument("-o", "--output", type=Path, required=True, metavar="FOLDER", help="for weights, log, picture")
    command.add_argument(
        "--set", nargs="+", default=[], metavar="GROUP.NAME=VALUE", dest="changes",
        help="in place of what the file says, such as training.precision=bfloat16",
    )  # fmt: skip
    command.add_argument("--threads", type=int, help="of the processor; one repeats bit for bit (default: torch's)")
    command.set_defaults(run=_run)


def _run(chosen: argparse.Namespace) -> None:
    # Here, so that other commands do not wait for what only this one needs.
    from meshot.report.segmentation import trained_segmentation

    if chosen.threads is not None:
        require_positive_integer(chosen.threads, "threads")
        torch.set_num_threads(chosen.threads)
    try:
        found = trained_segmentation(chosen.config, chosen.data, chosen.output, chosen.changes)
    except FloatingPointError as error:
        raise ValueError(str(error)) from error
    best = next(line for line in found.log if line["step"] == found.best_step and "dice_left" in line)
    print(
        f"best after {found.best_step} steps: Dice {best['dice_left']:.4f} left, {best['dice_right']:.4f} right on "
        f"validation; {found.cpu_seconds:.0f} s of processor time; weights in {chosen.output}"
    )
