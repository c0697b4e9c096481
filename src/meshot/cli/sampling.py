"""Arguments of the commands that compute the metrics from samples of points."""

import argparse


def add_sampling(command: argparse.ArgumentParser) -> None:
    """Add the numbers of points and the seed of ``meshot evaluate`` and ``meshot table``."""
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


def chosen_emd_points(chosen: argparse.Namespace) -> int:
    """The number of points for the EMD: at most the number of points on each surface."""
    return min(chosen.emd_points, chosen.points)
