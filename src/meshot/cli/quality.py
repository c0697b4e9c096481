"""``meshot quality STUDY``."""

import argparse
from pathlib import Path

from meshot.cli.note import NOTE, Commands
from meshot.files import printable_name


def add_to(commands: Commands) -> None:
    """Add the command ``quality`` and its arguments to the parser."""
    command = commands.add_parser(
        "quality",
        help="one page to look at all subjects of a study",
        description="Writes quality.html into the folder of a study: the slices of all subjects, their numbers, marks "
        f"on outliers, and verdicts by key that can be downloaded as a table. {NOTE}",
        epilog="The study: a folder with subjects.tsv, as meshot reconstruct writes it.",
    )
    command.add_argument("study", type=Path, help="the folder of the study")
    command.add_argument("--embed", action="store_true", help="put the pictures into the page, which can then be moved")
    command.set_defaults(run=_run)


def _run(chosen: argparse.Namespace) -> None:
    from meshot.study import write_quality_page

    path = write_quality_page(chosen.study, chosen.embed)
    print(f"look at {printable_name(path)}. {NOTE}")
