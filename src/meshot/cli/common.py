"""What commands have in common: the form of their help, ``--device``, and the options of a comparison."""

import argparse
import contextlib
import re
from collections.abc import Iterator
from importlib.metadata import entry_points
from pathlib import Path
from typing import TYPE_CHECKING

NOTE = "Not for clinical use."

#: The return type of ``ArgumentParser.add_subparsers``.
Commands = argparse._SubParsersAction


def known_systems() -> list[str]:
    """The names of all systems, sorted, as ``meshot.systems.system_names``, but without loading any of them."""
    settings = Path(__file__).parent.parent / "systems" / "settings"
    return sorted(
        {folder.name for folder in settings.iterdir()} | {e.name for e in entry_points(group="meshot.systems")}
    )


#: Kinds of options, as keyword arguments of ``add_argument``.
COUNT, FILE = {"type": int, "metavar": "N"}, {"type": Path, "metavar": "FILE"}
FOLDER = {"type": Path, "metavar": "FOLDER"}


class HelpParagraphs(argparse.HelpFormatter):
    """A formatter that fills each paragraph by itself and keeps the lines of examples, which are indented."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        paragraphs = text.split("\n\n")
        return "\n\n".join(
            part if part.startswith("  ") else super(HelpParagraphs, self)._fill_text(part, width, indent)
            for part in paragraphs
        )


def add_command(
    commands: Commands, name: str, summary: str, description: str, examples: str, more: str = "", usage: str = ""
) -> argparse.ArgumentParser:
    """Add a command whose help ends with examples."""
    lines = [f"  {line.strip()}" for line in examples.strip().splitlines()]
    heading = "Example:" if len(lines) == 1 else "Examples:"
    return commands.add_parser(
        name,
        help=summary,
        usage=usage or None,
        description=description,
        epilog="\n\n".join([*([more] if more else []), heading, "\n".join(lines)]),
        formatter_class=HelpParagraphs,
    )


# The option ``--device``: a device that can compute here, and clear words if it cannot or fails later.

if TYPE_CHECKING:  # for annotations only: importing torch would delay --help
    import torch


def device_of(chosen: argparse.Namespace) -> "torch.device | None":
    """The device given by ``--device``, or None if the option was not given."""
    import torch

    if chosen.device is None:
        return None
    try:
        device = torch.device(chosen.device)
        works = device.type != "meta" and float(torch.ones(1, device=device).cpu()) == 1
    except (RuntimeError, AssertionError, ImportError) as error:
        raise ValueError(_refusal(chosen.device, re.split(r"\n|\. ", str(error))[0])) from error
    if not works:
        raise ValueError(_refusal(chosen.device, "it holds no numbers"))
    return device


def _refusal(name: str, reason: str) -> str:
    import torch

    gpus = [f"cuda:{index}" for index in range(torch.cuda.device_count())] if torch.cuda.is_available() else []
    short = reason if len(reason) <= 200 else f"{reason[:200].rpartition(' ')[0]} ..."
    return f"--device {name}: PyTorch cannot compute there ({short}); use {' or '.join(['cpu', *gpus])}"


@contextlib.contextmanager
def device_errors() -> Iterator[None]:
    """Within the block, a failure of a GPU becomes a ValueError that says what to do."""
    import torch

    try:
        yield
    except torch.OutOfMemoryError as error:
        raise ValueError(
            f"the memory of the GPU is full ({str(error).partition('. ')[0]}); end other programs on it, use fewer "
            "--jobs, or use --device cpu"
        ) from error
    except torch.AcceleratorError as error:
        first = str(error).partition("\n")[0]
        raise ValueError(f"the GPU reports an error ({first}); try once more, or use --device cpu") from error


# Arguments of the commands that compare surfaces: ``meshot evaluate`` and ``meshot table``.

#: The surface that is compared unless another is named.
SURFACE = "white"


def add_sampling(command: argparse.ArgumentParser) -> None:
    """Add the numbers of points and the seed."""
    command.add_argument(
        "--points", **COUNT, default=100_000, help="Sample this many points on each surface (default: %(default)s)."
    )
    command.add_argument(
        "--emd-points",
        **COUNT,
        default=5_000,
        help="Use this many of the points for the EMD, at most --points (default: %(default)s).",
    )
    command.add_argument("--seed", **COUNT, default=0, help="Sample the points with this seed (default: %(default)s).")


def add_choice(command: argparse.ArgumentParser) -> None:
    """Add the surfaces of two folders that are compared, and the alignment."""
    command.add_argument(
        "--surface",
        default=SURFACE,
        metavar="NAME",
        help="Compare the surfaces of this name in two folders, such as white or pial (default: %(default)s).",
    )
    command.add_argument(
        "--common", action="store_true", help="Leave out what only one of the folders contains, with a warning."
    )
    command.add_argument(
        "--align",
        action="store_true",
        help="First align each surface rigidly with its reference by iterative closest points (ICP), as for two scans "
        "of one person in different positions. The residue of the alignment is reported.",
    )


def chosen_emd_points(chosen: argparse.Namespace) -> int:
    """The number of points for the EMD: at most the number of points on each surface."""
    return min(chosen.emd_points, chosen.points)
