"""``meshot table RECONSTRUCTED REFERENCE -o OUT``."""

import argparse
from pathlib import Path

from meshot.cli.common import FOLDER, NOTE, Commands, add_choice, add_command, add_sampling, chosen_emd_points
from meshot.files import printable_name


def add_to(commands: Commands) -> None:
    """Add the command ``table`` and its arguments to the parser."""
    command = add_command(
        commands,
        "table",
        "Compare a folder of surfaces with a reference folder.",
        "The command computes all metrics of meshot evaluate, with their floors, for every subject and side. It writes "
        f"them and their means over participants, with 95 % intervals, as tables and as a page. {NOTE}",
        """
        meshot table build/study freesurfer_subjects -o build/comparison
        meshot table second_scans first_scans -o build/consistency --align
        """,
        "Each folder is FreeSurfer's SUBJECTS_DIR, a data set of BIDS derivatives, or a folder of results of meshot "
        "reconstruct.",
    )
    command.add_argument("reconstructed", type=Path, help="The folder of the surfaces to evaluate.")
    command.add_argument("reference", type=Path, help="The folder of the surfaces that are taken as the truth.")
    command.add_argument(
        "-o", "--output", **FOLDER, required=True, help="Write the results to this folder, which is new or empty."
    )
    add_choice(command)
    add_sampling(command)
    command.set_defaults(run=_run)


def _run(chosen: argparse.Namespace) -> None:
    from tqdm import tqdm

    from meshot.study import COMPARISON_PAGE, write_comparison

    folders, emd_points = (chosen.reconstructed, chosen.reference, chosen.output), chosen_emd_points(chosen)
    settings = {"common": chosen.common, "align": chosen.align, "n_points": chosen.points, "seed": chosen.seed}
    settings["progress"] = lambda pairs: tqdm(pairs, unit="pair", disable=None)
    rows = write_comparison(*folders, chosen.surface, n_emd_points=emd_points, **settings)
    last = rows[-1]["side"]
    for row in rows:
        if row["side"] == last:
            print(f"{row['name']}: {row['mean']:.4g} {row['unit']}".rstrip() + f", floor {row['floor']:.4g}")
    print(
        f"participants: {rows[-1]['participants']}; look at {printable_name(chosen.output / COMPARISON_PAGE)}. {NOTE}"
    )
