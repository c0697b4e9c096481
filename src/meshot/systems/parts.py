"""One trained network of a system, and its reading from a file."""

import dataclasses
import reprlib
from collections.abc import Sequence
from pathlib import Path

from torch import nn

from meshot.model import read_weights


@dataclasses.dataclass(frozen=True, eq=False)
class Part:
    """One trained network of a system.

    Parameters
    ----------
    network : module
    record : dict
        JSON values: the settings, and the results of the training under ``results``.
    log : list of dict
        The log of the training. Empty if the network was read from a file.
    """

    network: nn.Module
    record: dict = dataclasses.field(default_factory=dict)
    log: list[dict] = dataclasses.field(default_factory=list)


def read_part(path: Path, kind: type[nn.Module], system: str, needed: Sequence[str]) -> Part:
    """Read ``PART.safetensors``.

    Parameters
    ----------
    path : pathlib.Path
    kind : type
        The class of the network.
    system : str
        The name of the system to which it must belong.
    needed : sequence of str
        The names of all parts of the system, for the message.

    Raises
    ------
    ValueError
        If the file is missing, damaged, or belongs to another system or part.
    """
    if not path.is_file():
        raise ValueError(
            f"{path} is missing; {system} needs {', '.join(needed)}: name a folder that holds them (--weights), or "
            f"train them (meshot train {system})"
        )
    network, record = read_weights(path, kind)
    for group in ("template", "training", "results"):
        if not isinstance(record.get(group, {}), dict):
            raise ValueError(f"{path} has {reprlib.repr(record[group])} as its {group}; names and values are needed")
    if record.get("system", system) != system:
        raise ValueError(
            f"{path} holds weights of the system {record['system']}; {system} was asked for: take --system "
            f"{record['system']}, or other weights"
        )
    if record.get("part", path.stem) != path.stem:
        raise ValueError(f"{path} holds {record['part']} of {system}; {path.stem} is needed: rename it")
    return Part(network, record)
