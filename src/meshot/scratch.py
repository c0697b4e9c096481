"""Temporary folders beside what is written, which a later run removes where a kill left them."""

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
except ImportError:  # Windows has no such locks: what a kill leaves there stays
    fcntl = None

#: Where :func:`meshot.files.whole_folder` keeps what gives way, under its own name, while folders change places.
OLD = "old"


@contextlib.contextmanager
def scratch_folder(parent: Path) -> Iterator[Path]:
    """A temporary folder in ``parent``, removed at the end; those that killed runs left there are removed first.

    The folder is locked (flock) as long as its process lives, and its name holds the name of this machine. A folder is
    taken for abandoned only if it was made on this machine and its lock is free. File systems without locks keep them.

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
    """Remove the temporary folders in ``parent`` whose process is gone; what they had set aside comes back first."""
    for folder in parent.glob(f"{_prefix()}*"):
        lock = _locked(folder, wait=False)
        if lock is None:
            continue
        for old in (folder / OLD).glob("*"):  # killed between two renames: the name is free, and its folder in here
            if not (parent / old.name).exists():
                old.rename(parent / old.name)
        shutil.rmtree(folder, ignore_errors=True)
        os.close(lock)


def _made(parent: Path) -> tuple[Path, int | None]:
    """A new folder and its lock; once more if another run took it for abandoned before it was locked."""
    folder, lock = _new(parent)
    while not folder.is_dir():
        if lock is not None:
            os.close(lock)
        folder, lock = _new(parent)
    return folder, lock


def _new(parent: Path) -> tuple[Path, int | None]:
    folder = Path(tempfile.mkdtemp(prefix=_prefix(), dir=parent))
    return folder, _locked(folder, wait=True)  # a run that is just removing it has the lock until it is gone


def _locked(folder: Path, wait: bool) -> int | None:
    """The descriptor of a folder that is locked now; None if it is gone, another process holds it, or nothing locks."""
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
