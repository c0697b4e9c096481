"""The command line: ``meshot evaluate PREDICTED TARGET``."""

import argparse
import json
import sys
import warnings
from collections.abc import Sequence
from pathlib import Path

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


def _to_stderr(message: Warning | str, *_: object) -> None:
    print(f"meshot: warning: {message}", file=sys.stderr)
