"""``meshot train CONFIG --data COHORT -o OUT``."""

import argparse
from pathlib import Path

from meshot.cli.note import NOTE, Commands
from meshot.cli.training import add_training_arguments, device_of, run_training


def add_to(commands: Commands) -> None:
    """Let the command line know the command and its arguments."""
    command = commands.add_parser(
        "train",
        help="train the network that deforms initial surfaces",
        description="Learn the flow from initial to true white surfaces of one side from cohorts (Algorithm 1 of "
        "the paper); stopped, the same command goes on, and with --threads 1 --device cpu ends with the same weights. "
        f"{NOTE}",
        epilog="Configurations: experiments/ddot/tiny.yaml, small.yaml, paper.yaml. CortexODE: --set loss.loss=chamfer "
        "loss.encoding=samples loss.factor=1000.",
    )
    add_training_arguments(command, "training.side=right training.seed=1")
    command.add_argument(
        "--segmentation", type=Path, metavar="FILE",
        help="weights of the network that makes the initial surfaces (default: those that come with the package)",
    )  # fmt: skip
    command.add_argument(
        "--initial", type=Path, default=Path("build/initial"), metavar="FOLDER",
        help="where initial surfaces are kept between trainings (default: %(default)s)",
    )  # fmt: skip
    command.set_defaults(run=_run)


def _run(chosen: argparse.Namespace) -> None:
    # Here, so that other commands do not wait for what only this one needs.
    from meshot.pipeline import SEGMENTATION, weights_path
    from meshot.pipeline.deformation import run_deformation_training

    segmentation = chosen.segmentation or weights_path(SEGMENTATION)
    run_training(
        chosen,
        lambda: run_deformation_training(
            chosen.config,
            chosen.data,
            chosen.output,
            segmentation,
            chosen.initial,
            chosen.changes,
            device_of(chosen),
        ),
        lambda best: f"ASSD {best['validation_loss']:.4f} mm, Hausdorff at 90 % {best['hausdorff90_mm']:.4f} mm",
    )
