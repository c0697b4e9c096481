"""The command line, ``meshot COMMAND``. Each command has a file of its own.

No file here imports torch, nor what is slow to load, before its command runs: help must come at once.
"""

import argparse
import sys
import warnings
from collections.abc import Sequence

import meshot
from meshot.cli import completion, deform, evaluate, inspect, make_cohort, quality, reconstruct, table, train, warmup
from meshot.cli.common import NOTE

COMMANDS = (evaluate, deform, inspect, reconstruct, quality, table, make_cohort, train, warmup, completion)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; the exit status is 0, or 2 where the input will not do (one line on stderr says why)."""
    # ``meshot reconstruct --strict`` exits with 3 where the result would come with a warning.
    chosen = make_parser().parse_args(arguments)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("always")
            warnings.simplefilter("ignore", ResourceWarning)  # files that nibabel leaves open where it fails
            warnings.showwarning = _to_stderr
            return chosen.run(chosen) or 0
    except (ValueError, OSError, ImportError) as error:
        print(f"meshot: {error}", file=sys.stderr)
        return getattr(error, "exit_status", 2)


def make_parser() -> argparse.ArgumentParser:
    """The parser of the whole command line, for :func:`main` and for its page in the book."""
    parser = argparse.ArgumentParser(prog="meshot", description=f"Meshes as measures: losses for surfaces. {NOTE}")
    parser.add_argument("--version", action="version", version=f"meshot {meshot.__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    for command in COMMANDS:
        command.add_to(commands)
    return parser


def _to_stderr(message: Warning | str, *_: object) -> None:
    print(f"meshot: warning: {message}", file=sys.stderr)
