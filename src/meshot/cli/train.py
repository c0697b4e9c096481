"""``meshot train CONFIG --data COHORT -o OUT``."""

import argparse
from pathlib import Path

import torch

from meshot.cli.note import NOTE, Commands
from meshot.errors import require_positive_integer


def add_to(commands: Commands) -> None:
    """Let the command line know the command and its arguments."""
    command = commands.add_parser(
        "train",
        help="train the network that deforms initial surfaces",
        description="Learn the flow from initial to true white surfaces of one side from cohorts (Algorithm 1 of "
        f"the paper); stopped, the same command goes on and ends with the same weights. {NOTE}",
        epilog="Configurations: experiments/ddot/tiny.yaml, small.yaml, paper.yaml. CortexODE: --set loss.loss=chamfer "
        "loss.encoding=samples loss.factor=1000.",
    )
    command.add_argument("config", type=Path, help="a YAML file: form of the network, its loss, how it is trained")
    command.add_argument("--data", type=Path, nargs="+", required=True, metavar="COHORT", help="folders of cohorts")
    command.add_argument("-o", "--output", type=Path, required=True, metavar="FOLDER", help="for weights, log, picture")
    command.add_argument(
        "--set", nargs="+", default=[], metavar="GROUP.NAME=VALUE", dest="changes",
        help="in place of what the file says, such as training.side=right training.seed=1",
    )  # fmt: skip
    command.add_argument(
        "--segmentation", type=Path, metavar="FILE",
        help="weights of the network that makes the initial surfaces (default: those that come with the package)",
    )  # fmt: skip
    command.add_argument(
        "--initial", type=Path, default=Path("build/initial"), metavar="FOLDER",
        help="where initial surfaces are kept between trainings (default: %(default)s)",
    )  # fmt: skip
    command.add_argument("--threads", type=int, help="of the processor; one repeats bit for bit (default: torch's)")
    command.set_defaults(run=_run)


def _run(chosen: argparse.Namespace) -> None:
    # Here, so that other commands do not wait for what only this one needs.
    from meshot.model.shipped import SEGMENTATION, weights_path
    from meshot.report.deformation import trained_deformation

    if chosen.threads is not None:
        require_positive_integer(chosen.threads, "threads")
        torch.set_num_threads(chosen.threads)
    segmentation = chosen.segmentation or weights_path(SEGMENTATION)
    try:
        found = trained_deformation(
            chosen.config, chosen.data, chosen.output, segmentation, chosen.initial, chosen.changes
        )
    except FloatingPointError as error:
        raise ValueError(str(error)) from error
    best = next(line for line in found.log if line["step"] == found.best_step and "hausdorff90_mm" in line)
    print(
        f"best after {found.best_step} steps: ASSD {best['validation_loss']:.4f} mm, Hausdorff at 90 % "
        f"{best['hausdorff90_mm']:.4f} mm on validation; {found.cpu_seconds:.0f} s of processor time; weights in "
        f"{chosen.output}"
    )
