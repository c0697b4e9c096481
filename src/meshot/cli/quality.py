"""``meshot quality STUDY``."""

import argparse
from pathlib import Path

from meshot.cli.common import NOTE, Commands, add_command
from meshot.files import printable_name


def add_to(commands: Commands) -> None:
    """Add the command ``quality`` and its arguments to the parser."""
    command = add_command(
        commands,
        "quality",
        "Write one page that shows all subjects of a study.",
        "The command writes quality.html into the folder of a study. The page shows slices of all subjects and their "
        f"numbers, and marks outliers. Verdicts are given by key and can be downloaded as a table. {NOTE}",
        "meshot quality build/study",
        "A study is a folder with the table subjects.tsv, as meshot reconstruct writes it, or the folder of one scan.",
    )
    command.add_argument("study", type=Path, help="The folder of the study.")
    command.add_argument(
        "--embed", action="store_true", help="Put the pictures into the page, so that it can be moved or sent alone."
    )
    command.set_defaults(run=_run)


def _run(chosen: argparse.Namespace) -> None:
    from meshot.study import write_quality_page

    path = write_quality_page(chosen.study, chosen.embed)
    print(f"look at {printable_name(path)}. {NOTE}")
