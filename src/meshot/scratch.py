"""Temporary folders beside the output. Those that killed runs left are removed by later runs."""

import contextlib
import os
import platform
import re
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows has no such locks: folders of killed runs are not removed there
    fcntl = None

#: Subfolder in which :func:`meshot.files.whole_folder` keeps a replaced folder during the exchange.
OLD = "old"


@contextlib.contextmanager
def scratch_folder(parent: Path) -> Iterator[Path]:
    """Yield a temporary folder in ``parent`` and remove it at the end. Folders left by killed runs are removed first.

    The folder is locked (flock) while its process lives, and its name contains the name of the machine. A folder is
    removed only if it was made on this machine and its lock is free. On file systems without locks nothing is removed.

    Parameters
    ----------
    parent : path
        An existing folder.

    Yields
    ------
    pathlib.Path
        The folder, empty.
    """
    remove_abandoned(parent)
    folder, lock = _made(parent)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        if lock is not None:
            os.close(lock)


def remove_abandoned(parent: Path) -> None:
    """Remove the temporary folders in ``parent`` whose process has ended. Folders set aside in them are restored."""
    for folder in parent.glob(f"{_prefix()}*"):
        lock = _locked(folder, wait=False)
        if lock is None:
            continue
        for old in (folder / OLD).glob("*"):  # the process was killed between two renames
            if not (parent / old.name).exists():
                old.rename(parent / old.name)
        shutil.rmtree(folder, ignore_errors=True)
        os.close(lock)


def _made(parent: Path) -> tuple[Path, int | None]:
    """A new folder and its lock. Repeated if another run removed the folder before it was locked."""
    folder, lock = _new(parent)
    while not folder.is_dir():
        if lock is not None:
            os.close(lock)
        folder, lock = _new(parent)
    return folder, lock


def _new(parent: Path) -> tuple[Path, int | None]:
    folder = Path(tempfile.mkdtemp(prefix=_prefix(), dir=parent))
    return folder, _locked(folder, wait=True)  # another run that is removing the folder holds the lock until then


def _locked(folder: Path, wait: bool) -> int | None:
    """The descriptor of the folder, now locked; None if it is gone, locked by another process, or cannot be locked."""
    descriptor = None
    if fcntl is not None:
        with contextlib.suppress(OSError):
            descriptor = os.open(folder, os.O_RDONLY)
            fcntl.flock(descriptor, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)
            return descriptor
    if descriptor is not None:
        os.close(descriptor)
    return None


def _prefix() -> str:
    return f".writing-{re.sub(r'[^A-Za-z0-9]', '', platform.node())}-"
