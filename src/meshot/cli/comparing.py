"""Arguments of the commands that compare surfaces: ``meshot evaluate`` and ``meshot table``."""

import argparse

#: The surface that is compared unless another is named.
SURFACE = "white"


def add_sampling(command: argparse.ArgumentParser) -> None:
    """Add the numbers of points and the seed."""
    command.add_argument(
        "--points", type=int, default=100_000, metavar="N",
        help="Sample this many points on each surface (default: %(default)s).",
    )  # fmt: skip
    command.add_argument(
        "--emd-points", type=int, default=5_000, metavar="N",
        help="Use this many of the points for the EMD, at most --points (default: %(default)s).",
    )  # fmt: skip
    command.add_argument(
        "--seed", type=int, default=0, metavar="N", help="Sample the points with this seed (default: %(default)s)."
    )


def add_choice(command: argparse.ArgumentParser) -> None:
    """Add the surfaces of two folders that are compared, and the alignment."""
    command.add_argument(
        "--surface", default=SURFACE, metavar="NAME",
        help="Compare the surfaces of this name in two folders, such as white or pial (default: %(default)s).",
    )  # fmt: skip
    command.add_argument(
        "--common", action="store_true", help="Leave out what only one of the folders contains, with a warning."
    )
    command.add_argument(
        "--align", action="store_true",
        help="First align each surface rigidly with its reference by iterative closest points (ICP), as for two scans "
        "of one person in different positions. The residue of the alignment is reported.",
    )  # fmt: skip


def chosen_emd_points(chosen: argparse.Namespace) -> int:
    """The number of points for the EMD: at most the number of points on each surface."""
    return min(chosen.emd_points, chosen.points)
