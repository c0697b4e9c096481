"""Reading of gzip and bzip2 files to the end, so that the checksum is verified, up to a maximum size."""

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
    """The content of a file, decompressed if its first bytes mark it as gzip or bzip2.

    Parameters
    ----------
    path : path
    largest : int
        Maximum size of the decompressed content, in bytes.

    Raises
    ------
    ValueError
        If the content is larger, or the compressed stream is truncated or does not match its checksum.
    """
    return b"".join(_blocks(Path(path), largest))


def unpacked_size(path: str | os.PathLike, largest: int) -> int:
    """The size in bytes of what :func:`unpacked` returns, without holding it in memory. Raises the same errors."""
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
    """Open a file for reading, with decompression if its first bytes mark it as gzip or bzip2."""
    path = Path(path)
    return _opener(path)(path, "rb")


def _opener(path: Path) -> Callable[..., io.BufferedIOBase]:
    with path.open("rb") as file:
        head = file.read(3)
    return next((opener for mark, opener in _OPENERS.items() if head.startswith(mark)), open)
