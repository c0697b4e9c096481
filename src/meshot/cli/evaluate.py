"""``meshot evaluate PREDICTED TARGET``."""

import argparse
import json
from pathlib import Path

from meshot.cli.note import NOTE, Commands
from meshot.files import whole_file
from meshot.mesh import read_mesh
from meshot.metrics import evaluate


def add_to(commands: Commands) -> None:
    """Let the command line know the command and its arguments."""
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
    command.set_defaults(run=_run)


def _run(chosen: argparse.Namespace) -> None:
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
