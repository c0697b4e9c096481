"""``meshot reconstruct SCAN -o OUT``."""

import argparse
import warnings
from pathlib import Path

from meshot.cli.note import NOTE, Commands
from meshot.files import printable_name


def add_to(commands: Commands) -> None:
    """Let the command line know the command and its arguments."""
    command = commands.add_parser(
        "reconstruct",
        help="the white surfaces of both hemispheres in a scan",
        description="From one T1 to the white surfaces of both hemispheres in scanner RAS (FreeSurfer, GIfTI, PLY), "
        f"with the transform to MNI152, all numbers and a page to look at. {NOTE}",
        epilog="The scan: a T1 of an adult head without its skull, in any orientation and voxel size, NIfTI or MGH. "
        "A scan with its skull needs a brain mask, such as SynthStrip or HD-BET make.",
    )
    command.add_argument("scan", type=Path, help="the T1")
    command.add_argument("-o", "--output", type=Path, required=True, metavar="FOLDER", help="new or empty")
    command.add_argument("--overwrite", action="store_true", help="replace an earlier reconstruction in that folder")
    command.add_argument("--system", metavar="NAME", help="how the surfaces are found (default: what is shipped)")
    command.add_argument("--weights", type=Path, metavar="FOLDER", help="of the system, other than those shipped")
    command.add_argument("--segmentation", type=Path, metavar="FILE", help="weights other than those shipped")
    command.add_argument("--initial-only", action="store_true", help="no system: the initial surfaces are the result")
    command.add_argument("--brain-mask", type=Path, metavar="FILE", help="leave out what lies where this volume is 0")
    command.add_argument("--strict", action="store_true", help="refuse, with exit status 3, where others are warned")
    command.add_argument("--threads", type=int, help="of the processor (default: torch's)")
    command.set_defaults(run=_run)


def _run(chosen: argparse.Namespace) -> None:
    # Here, so that other commands do not wait for what only this one needs.
    import torch

    from meshot.errors import require_positive_integer
    from meshot.pipeline import load_networks
    from meshot.pipeline.report import PAGE, write_reconstruction

    if chosen.threads is not None:
        require_positive_integer(chosen.threads, "threads")
        torch.set_num_threads(chosen.threads)
    networks = load_networks(chosen.system, chosen.weights, chosen.segmentation, chosen.initial_only)
    report = write_reconstruction(
        chosen.scan, chosen.output, networks, chosen.overwrite, brain_mask=chosen.brain_mask, strict=chosen.strict
    )
    for side, surface in report["surfaces"].items():
        final = surface["final"]
        print(
            f"{side}: χ = {final['euler_number']}, {final['n_self_intersecting_faces']} self-intersecting of "
            f"{final['n_faces']} faces, {final['volume_cm3']:.0f} cm³"
        )
    for warning in report["warnings"]:
        warnings.warn(warning, stacklevel=1)
    print(f"{sum(report['seconds']['clock'].values()):.0f} s; look at {printable_name(chosen.output / PAGE)}. {NOTE}")
