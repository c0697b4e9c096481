"""``meshot table RECONSTRUCTED REFERENCE -o OUT``."""

import argparse
from pathlib import Path

from meshot.cli.note import NOTE, Commands
from meshot.files import printable_name


def add_to(commands: Commands) -> None:
    """Add the command ``table`` and its arguments to the parser."""
    command = commands.add_parser(
        "table",
        help="compare a folder of surfaces with a reference folder",
        description="All metrics of meshot evaluate for every subject and side, with floors, and their means over "
        f"participants with 95 % intervals, as tables and a page. {NOTE}",
        epilog="A folder: FreeSurfer's SUBJECTS_DIR, BIDS derivatives, or a folder of results of meshot reconstruct.",
    )
    command.add_argument("reconstructed", type=Path, help="the folder of the surfaces to evaluate")
    command.add_argument("reference", type=Path, help="the folder of the surfaces to compare with")
    command.add_argument("-o", "--output", type=Path, required=True, metavar="FOLDER", help="new or empty")
    command.add_argument("--surface", default="white", help="such as white or pial (default: %(default)s)")
    command.add_argument(
        "--common", action="store_true", help="leave out what is in one of the folders only, with a warning"
    )
    command.add_argument(
        "--points", type=int, default=100_000, help="number of points on each surface (default: %(default)s)"
    )
    command.add_argument(
        "--emd-points", type=int, default=5_000, help="number of these points for the EMD (default: %(default)s)"
    )
    command.add_argument("--seed", type=int, default=0, help="seed of the points (default: %(default)s)")
    command.set_defaults(run=_run)


def _run(chosen: argparse.Namespace) -> None:
    from tqdm import tqdm

    from meshot.study import COMPARISON_PAGE, write_comparison

    rows = write_comparison(
        chosen.reconstructed, chosen.reference, chosen.output, chosen.surface, common=chosen.common,
        n_points=chosen.points, n_emd_points=chosen.emd_points, seed=chosen.seed,
        progress=lambda pairs: tqdm(pairs, unit="pair", disable=None),
    )  # fmt: skip
    last = rows[-1]["side"]
    for row in rows:
        if row["side"] == last:
            print(f"{row['name']}: {row['mean']:.4g} {row['unit']}".rstrip() + f", floor {row['floor']:.4g}")
    print(
        f"participants: {rows[-1]['participants']}; look at {printable_name(chosen.output / COMPARISON_PAGE)}. {NOTE}"
    )
