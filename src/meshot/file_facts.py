"""What a file of a surface or of a scan says about itself: format, space, contradictions, and what is not read."""

import dataclasses
import os
import warnings


class FileWarning(UserWarning):
    """A file contradicts itself, or is not quite what its name or its header says. The message has the values."""


@dataclasses.dataclass(frozen=True)
class FileFacts:
    """What a file says about itself.

    Parameters
    ----------
    format : str
        With the variant, such as "PLY, binary, little endian".
    space : str
        The space of the coordinates as they are read.
    said_by : str
        The field of the file that says so, and how the stored coordinates were changed.
    faults : tuple of str
        Contradictions, and what had to be left out or mended. Readers warn about each, or refuse the file if they are
        strict.
    not_read : tuple of str
        What the file holds besides, and what is lost in a conversion.
    numbers : tuple of pairs
        Name and value of what else is worth knowing, such as the sizes of voxels.
    """

    format: str
    space: str
    said_by: str
    faults: tuple[str, ...] = ()
    not_read: tuple[str, ...] = ()
    numbers: tuple[tuple[str, str], ...] = ()


class ContradictoryFileError(ValueError):
    """A file that is read strictly contradicts itself."""

    exit_status = 3


def heed(path: str | os.PathLike, facts: FileFacts, strict: bool) -> None:
    """Warn about every fault of a file, or refuse the file.

    Raises
    ------
    ContradictoryFileError
        If there is a fault and ``strict`` is set.
    """
    if facts.faults and strict:
        raise ContradictoryFileError(f"{path} is refused, because it is read strictly: {'; '.join(facts.faults)}")
    for fault in facts.faults:
        warnings.warn(f"{path}: {fault}", FileWarning, stacklevel=3)
