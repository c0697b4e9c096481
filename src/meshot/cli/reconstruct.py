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
        help="find the white surfaces of both hemispheres in a scan",
        description="Writes the surfaces in scanner RAS (FreeSurfer, GIfTI, PLY), the transform to MNI152, "
        f"all numbers, and a report page. {NOTE}",
        epilog="The scan should be a T1 of an adult head without its skull, as NIfTI or MGH, in any orientation and "
        "voxel size. A scan with its skull needs a brain mask, made by SynthStrip or HD-BET for example.",
    )
    command.add_argument("scan", type=Path, help="the T1-weighted scan")
    command.add_argument(
        "-o", "--output", type=Path, required=True, metavar="FOLDER", help="the folder for the results, new or empty"
    )
    command.add_argument("--overwrite", action="store_true", help="replace an earlier reconstruction in that folder")
    command.add_argument(
        "--system", metavar="NAME", help="the system that finds the surfaces (default: that of the package)"
    )
    command.add_argument(
        "--weights", type=Path, metavar="FOLDER", help="weights of the system (default: those of the package)"
    )
    command.add_argument(
        "--segmentation", type=Path, metavar="FILE", help="weights of the segmentation (default: those of the package)"
    )
    command.add_argument("--initial-only", action="store_true", help="stop after the initial surfaces, without a flow")
    command.add_argument("--brain-mask", type=Path, metavar="FILE", help="a volume that is 0 outside the brain")
    command.add_argument("--strict", action="store_true", help="stop with exit status 3 instead of a warning")
    command.add_argument("--threads", type=int, help="number of processor threads (default: that of torch)")
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
