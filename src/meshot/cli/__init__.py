"""The command line: ``meshot COMMAND``; each command in a file of its own, with its arguments."""

import argparse
import sys
import warnings
from collections.abc import Sequence

from meshot.cli import evaluate, reconstruct, train, train_segmentation
from meshot.cli.note import NOTE

COMMANDS = (evaluate, reconstruct, train, train_segmentation)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; the exit status is 0, or 2 where the input will not do (one line on stderr says why).

    Parameters
    ----------
    arguments : sequence of str, optional
        Those of the process if left out.
    """
    chosen = _parser().parse_args(arguments)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("always")
            warnings.showwarning = _to_stderr
            chosen.run(chosen)
    except (ValueError, OSError) as error:
        print(f"meshot: {error}", file=sys.stderr)
        return 2
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="meshot", description=f"Meshes as measures: losses for surfaces. {NOTE}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    for command in COMMANDS:
        command.add_to(commands)
    return parser


def _to_stderr(message: Warning | str, *_: object) -> None:
    print(f"meshot: warning: {message}", file=sys.stderr)
