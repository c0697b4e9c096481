"""Files and folders that are written completely or not at all: first under a temporary name, then renamed."""

import contextlib
import errno
import os
import re
import tempfile
from collections.abc import Iterator
from pathlib import Path

from meshot.scratch import OLD, scratch_folder

_FULL = (errno.ENOSPC, errno.EDQUOT)
_SAID = re.compile(r"No space left on device|\d+ requested and \d+ written")  # messages of safetensors and numpy
_IN_THE_WAY = (errno.ENOTEMPTY, errno.EEXIST, errno.ENOTDIR)


def printable_name(path: str | os.PathLike) -> str:
    """A path as text that can be printed and stored: bytes that are not valid UTF-8 become U+FFFD."""
    return os.fsencode(path).decode("utf-8", errors="replace")


@contextlib.contextmanager
def whole_file(path: str | os.PathLike) -> Iterator[Path]:
    """Yield a temporary path beside ``path`` that is renamed to ``path`` if the block ends without an error.

    Parameters
    ----------
    path : path
        The final path. Its folder is created if it is missing.

    Yields
    ------
    pathlib.Path
        The path to write to. It has the same suffixes as ``path``.

    Raises
    ------
    OSError
        If the disk is full. The message names the path.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    with naming_a_full_disk(path), scratch_folder(path.parent) as folder:
        temporary, usual = folder / path.name, folder / ".usual"
        yield temporary
        # Some writers create files that only the owner can read. Give the file the usual permissions (umask).
        usual.touch()
        temporary.chmod(usual.stat().st_mode)
        os.replace(temporary, path)


@contextlib.contextmanager
def whole_folder(path: str | os.PathLike, replace: bool = False) -> Iterator[Path]:
    """Yield a temporary folder beside ``path`` that is renamed to ``path`` if the block ends without an error.

    If something else appears at ``path`` while the block runs, it is left as it is, and this call raises. Of two runs
    that write the same folder, the first to end therefore succeeds.

    Parameters
    ----------
    path : path
        The final folder. Its parent is created if it is missing. A link is followed.
    replace : bool
        Whether an existing folder that is not empty is replaced. It stays unchanged until the block has ended.

    Yields
    ------
    pathlib.Path
        The folder to write into.

    Raises
    ------
    ValueError
        If ``path`` is a file, or a folder that is not empty while ``replace`` is false, or the working folder, or a
        mount point, or if it changed while the block ran.
    OSError
        If the disk is full. The message names the path.
    """
    path = Path(path)
    if path.exists() and not path.is_dir():
        raise ValueError(f"{path} is a file; a folder is needed: choose another name")
    if path.is_dir() and any(path.iterdir()) and not replace:
        raise ValueError(f"{path} exists and is not empty; choose another name, or remove it first")
    if path.resolve() == Path.cwd() or path.is_mount():
        raise ValueError(
            f"{path} is the working folder, or one where something is mounted, and cannot be exchanged for another; "
            f"name a folder in it: {path / 'out'}"
        )
    path = path.resolve()
    path.parent.mkdir(parents=True, exist_ok=True)
    with naming_a_full_disk(path), scratch_folder(path.parent) as place:
        before = _contents(path)
        temporary = place / "new" / path.name
        temporary.mkdir(parents=True)
        yield temporary
        _exchange(path, temporary, place / OLD / path.name, before)


def _exchange(path: Path, new: Path, old: Path, before: dict[str, tuple[int, ...]]) -> None:
    """Rename ``new`` to ``path`` if ``path`` is unchanged. A folder that is replaced is first renamed to ``old``."""
    if before:
        old.parent.mkdir()
        with contextlib.suppress(FileNotFoundError):  # removed meanwhile by someone else: nothing to set aside
            os.rename(path, old)
    try:
        if old.exists() and _contents(old) != before:
            raise ValueError(_changed(path))
        os.rename(new, path)  # fails unless ``path`` is absent or an empty folder
    except BaseException as error:
        if old.exists():
            _bring_back(old, path)
        if getattr(error, "errno", None) in _IN_THE_WAY:
            raise ValueError(_changed(path)) from error
        raise


def _bring_back(old: Path, path: Path) -> None:
    try:
        os.rename(old, path)
    except OSError as error:
        kept = Path(tempfile.mkdtemp(prefix=f"{path.name}.before-", dir=path.parent))
        os.rename(old, kept)
        raise ValueError(f"{_changed(path)}; what was there at the start is in {kept}") from error


def _contents(folder: Path) -> dict[str, tuple[int, ...]]:
    """Inode, size and time of change of everything under a folder, by relative path; empty if there is no folder."""
    found = {}
    for parent, folders, files in os.walk(folder):
        for name in folders + files:
            state = os.lstat(os.path.join(parent, name))
            key = os.path.relpath(os.path.join(parent, name), folder)
            found[key] = (state.st_ino, state.st_size, state.st_mtime_ns)
    return found


def _changed(path: Path) -> str:
    return (
        f"{path} changed while this run was made, perhaps by another run: it is left as it is, and this run is "
        "discarded; choose another folder"
    )


@contextlib.contextmanager
def naming_a_full_disk(path: Path) -> Iterator[None]:
    """Name the disk when it is full: writers say that no space is left, but not where.

    Raises
    ------
    OSError
        In place of an error that says that no space is left.
    """
    try:
        yield
    except Exception as error:
        if getattr(error, "errno", None) in _FULL or _SAID.search(str(error)):
            message = f"the disk or quota of {path.parent} is full; make room, or write elsewhere"
            raise OSError(errno.ENOSPC, message, str(path)) from error
        raise


def named_file(name: str | os.PathLike, folder: Path) -> Path:
    """The path of a YAML file: ``name`` itself if it is a path, or the file of that name in a folder of the package.

    Parameters
    ----------
    name : path or str
        A path, or a single word without suffix.
    folder : path
        The folder of the package where words are looked up.

    Raises
    ------
    ValueError
        If ``name`` is a single word and there is no file of that name.
    """
    path = Path(name)
    if path.suffix or len(path.parts) != 1:
        return path
    known = sorted(file.stem for file in folder.glob("*.yaml"))
    if path.name not in known:
        raise ValueError(
            f"{path.name} is not known; the package has {', '.join(known)}, or name a file: {path.name}.yaml"
        )
    return folder / f"{path.name}.yaml"
