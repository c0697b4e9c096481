"""Compressed files read to their end, where their checksum is, and no further than a stated size."""

import bz2
import gzip
import io
import os
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

_BLOCK = 1 << 20
_OPENERS = {b"\x1f\x8b": gzip.open, b"BZh": bz2.open}


def unpacked(path: str | os.PathLike, largest: int) -> bytes:
    """What a file holds, decompressed if it is gzip or bzip2 by its first bytes.

    Parameters
    ----------
    path : path
    largest : int
        The most bytes that are unpacked.

    Raises
    ------
    ValueError
        If there are more, or the compressed stream is cut short or does not match its checksum.
    """
    return b"".join(_blocks(Path(path), largest))


def unpacked_size(path: str | os.PathLike, largest: int) -> int:
    """The number of bytes that :func:`unpacked` would return, without holding them; raises what it raises."""
    path = Path(path)
    return path.stat().st_size if _opener(path) is open else sum(len(block) for block in _blocks(path, largest))


def _blocks(path: Path, largest: int) -> Iterator[bytes]:
    n_bytes = 0
    try:
        with opened(path) as file:
            while block := file.read(_BLOCK):
                n_bytes += len(block)
                if n_bytes > largest:
                    raise ValueError(f"{path} holds more than {largest >> 20} MiB unpacked; at most so much is read")
                yield block
    except (OSError, EOFError, zlib.error) as error:
        raise ValueError(f"{path} is cut short or damaged: {error}; get the file again") from error


def opened(path: str | os.PathLike) -> io.BufferedIOBase:
    """A file to read from, decompressed on the way if it is gzip or bzip2 by its first bytes."""
    path = Path(path)
    return _opener(path)(path, "rb")


def _opener(path: Path) -> Callable[..., io.BufferedIOBase]:
    with path.open("rb") as file:
        head = file.read(3)
    return next((opener for mark, opener in _OPENERS.items() if head.startswith(mark)), open)
