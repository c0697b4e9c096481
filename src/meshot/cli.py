"""The command line: ``meshot evaluate PREDICTED TARGET``, ``meshot train-segmentation CONFIG --data COHORT -o OUT``."""

import argparse
import json
import sys
import warnings
from collections.abc import Sequence
from pathlib import Path

import torch

from meshot.errors import require_positive_integer
from meshot.files import whole_file
from meshot.mesh.io import read_mesh
from meshot.metrics.evaluate import evaluate

NOTE = "Not for clinical use."


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; the exit status is 0, or 2 where the input will not do (one line on stderr says why).

    Parameters
    ----------
    arguments : sequence of str, optional
        Those of the process if left out.
    """
    chosen = _parser().parse_args(arguments)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("always")
            warnings.showwarning = _to_stderr
            chosen.run(chosen)
    except (ValueError, OSError) as error:
        print(f"meshot: {error}", file=sys.stderr)
        return 2
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="meshot", description=f"Meshes as measures: losses for surfaces. {NOTE}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    command = commands.add_parser(
        "evaluate",
        help="how close a surface is to a target surface",
        description="EMD, SWD, ASSD, Hausdorff at 90 %, normals, self-intersection, topology, size and triangles, each "
        f"with its unit and with what the target scores against itself (the floor). {NOTE}",
        epilog="Meshes: PLY, OBJ, OFF, STL, GIfTI, FreeSurfer. Both in the same space, in mm.",
    )
    command.add_argument("predicted", type=Path, help="the surface to judge")
    command.add_argument("target", type=Path, help="the surface it should be")
    command.add_argument("--points", type=int, default=100_000, help="drawn on each surface (default: %(default)s)")
    command.add_argument(
        "--emd-points", type=int, default=5_000, help="the first of them, for the EMD (default: %(default)s)"
    )
    command.add_argument("--emd-blur", type=float, metavar="MM", help="EMD by Sinkhorn's algorithm with this blur")
    command.add_argument("--seed", type=int, default=0, help="of the points (default: %(default)s)")
    command.add_argument("--json", type=Path, metavar="FILE", help="write everything to a file as well")
    command.add_argument("--definitions", action="store_true", help="say what each metric is")
    command.set_defaults(run=_evaluate)
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
    command.add_argument("--threads", type=int, help="of the processor; one repeats bit for bit (default: torch's)")
    command.set_defaults(run=_train_segmentation)
    return parser


def _evaluate(chosen: argparse.Namespace) -> None:
    found = evaluate(
        read_mesh(chosen.predicted), read_mesh(chosen.target), chosen.points, chosen.seed, chosen.emd_points,
        chosen.emd_blur,
    )  # fmt: skip
    print(found)
    if chosen.definitions:
        print(f"\n{found.definitions()}")
    if chosen.json:
        with whole_file(chosen.json) as temporary:
            temporary.write_text(json.dumps(found.as_dict(), indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def _train_segmentation(chosen: argparse.Namespace) -> None:
    # Here, so that other commands do not wait for what only this one needs.
    from meshot.report.segmentation import trained_segmentation

    if chosen.threads is not None:
        require_positive_integer(chosen.threads, "threads")
        torch.set_num_threads(chosen.threads)
    try:
        found = trained_segmentation(chosen.config, chosen.data, chosen.output)
    except FloatingPointError as error:
        raise ValueError(str(error)) from error
    best = next(line for line in found.log if line["step"] == found.best_step and "dice_left" in line)
    print(
        f"best after {found.best_step} steps: Dice {best['dice_left']:.4f} left, {best['dice_right']:.4f} right on "
        f"validation; {found.cpu_seconds:.0f} s of processor time; weights in {chosen.output}"
    )


def _to_stderr(message: Warning | str, *_: object) -> None:
    print(f"meshot: warning: {message}", file=sys.stderr)
