"""The arguments of ``meshot reconstruct``."""

import argparse
from pathlib import Path


def add_reconstruction_arguments(command: argparse.ArgumentParser) -> None:
    """Add the scans, the folder of the results, and all options.

    Parameters
    ----------
    command : argparse.ArgumentParser
    """
    command.add_argument(
        "scan", type=Path, nargs="+", help="A T1-weighted scan, several scans, a folder of scans, or a BIDS data set."
    )
    _add_output(command)
    _add_networks(command)
    _add_correspondence(command)
    _add_care(command)
    _add_words(command.add_mutually_exclusive_group())
    _add_bids(command.add_argument_group("of a BIDS data set"))


def _add_output(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="FOLDER",
        help="Write the results to this folder, which is new, empty or of the same study.",
    )
    command.add_argument(
        "--layout",
        choices=("flat", "freesurfer", "bids"),
        default="flat",
        help="Arrange results in flat folders, as FreeSurfer's SUBJECTS_DIR or as BIDS derivatives "
        "(default: %(default)s).",
    )
    command.add_argument(
        "--jobs",
        type=int,
        default=1,
        metavar="N",
        help="Reconstruct this many scans of a study side by side (default: %(default)s).",
    )
    command.add_argument("--overwrite", action="store_true", help="Replace an earlier reconstruction in the folder.")


def _add_care(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--brain-mask", type=Path, metavar="FILE", help="Use this volume, which is 0 outside the brain."
    )
    command.add_argument("--strict", action="store_true", help="Stop with exit status 3 instead of a warning.")
    command.add_argument(
        "--threads",
        type=int,
        metavar="N",
        help="Use this many threads in each process (default: as many as torch chooses; 1 with several jobs).",
    )


def _add_words(group: argparse._MutuallyExclusiveGroup) -> None:
    group.add_argument("--verbose", action="store_true", help="Also print how long each stage of a scan took.")
    group.add_argument("--quiet", action="store_true", help="Print warnings and errors only, and no progress bar.")


def _add_networks(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--system", metavar="NAME", help="Find the surfaces with this system (default: that of the package)."
    )
    command.add_argument(
        "--weights",
        type=Path,
        metavar="FOLDER",
        help="Use the weights of the system in this folder (default: those of the package).",
    )
    command.add_argument(
        "--segmentation",
        type=Path,
        metavar="FILE",
        help="Use the segmentation network of this file (default: that of the package).",
    )
    command.add_argument("--initial-only", action="store_true", help="Stop after the initial surfaces, without a flow.")
    command.add_argument(
        "--device", help="Compute the networks on this device: cpu, cuda or cuda:1, for example (default: cpu)."
    )


def _add_correspondence(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--template",
        action="store_true",
        help="Also carry fsaverage5's white surface to each side, so that vertices correspond between people; one to "
        "two minutes more.",
    )


def _add_bids(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--participant-label",
        "--participant_label",
        nargs="+",
        default=[],
        metavar="LABEL",
        help="Reconstruct these participants (default: all).",
    )
    group.add_argument(
        "--session-label",
        "--session_label",
        nargs="+",
        default=[],
        metavar="LABEL",
        help="Reconstruct these sessions (default: all).",
    )
    group.add_argument("--acquisition", metavar="LABEL", help="Use only scans with this value of acq.")
    group.add_argument("--run", metavar="NUMBER", dest="run_number", help="Use only scans with this value of run.")
    group.add_argument(
        "--runs",
        choices=("average", "first"),
        default="average",
        help="Register and average several runs, or use the first (default: %(default)s).",
    )
    group.add_argument(
        "--derivatives", type=Path, metavar="FOLDER", help="Take brain masks from this BIDS data set of derivatives."
    )
