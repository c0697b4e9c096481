"""Files and folders that are either whole or absent: written to a temporary name, then renamed."""

import contextlib
import errno
import os
import re
import tempfile
from collections.abc import Iterator
from pathlib import Path

from meshot.scratch import OLD, scratch_folder

_FULL = (errno.ENOSPC, errno.EDQUOT)
_SAID = re.compile(r"No space left on device|\d+ requested and \d+ written")  # safetensors; numpy
_IN_THE_WAY = (errno.ENOTEMPTY, errno.EEXIST, errno.ENOTDIR)


def printable_name(path: str | os.PathLike) -> str:
    """A path as text that can be printed and stored: bytes that are no UTF-8 become U+FFFD."""
    return os.fsencode(path).decode("utf-8", errors="replace")


@contextlib.contextmanager
def whole_file(path: str | os.PathLike) -> Iterator[Path]:
    """A temporary path beside ``path``, with its suffixes, that takes its name when the block ends without an error.

    Parameters
    ----------
    path : path
        Where the file shall be; its folder is made if it is missing.

    Yields
    ------
    pathlib.Path
        What to write to.

    Raises
    ------
    OSError
        If the disk is full; the message names the path.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    with naming_a_full_disk(path), scratch_folder(path.parent) as folder:
        temporary, usual = folder / path.name, folder / ".usual"
        yield temporary
        # Some writers leave a file that only its owner can read; everybody else's files are as the umask says.
        usual.touch()
        temporary.chmod(usual.stat().st_mode)
        os.replace(temporary, path)


@contextlib.contextmanager
def whole_folder(path: str | os.PathLike, replace: bool = False) -> Iterator[Path]:
    """A temporary folder beside ``path`` that takes its name when the block ends without an error.

    What appears at ``path`` while the block runs is left as it is: of two runs that write the same folder the first to
    end wins, and the other raises.

    Parameters
    ----------
    path : path
        Where the folder shall be; the one that holds it is made if it is missing. A link is followed.
    replace : bool
        Whether a folder that is there, and not empty, gives way; until the block has ended it stays as it is.

    Yields
    ------
    pathlib.Path
        What to write into.

    Raises
    ------
    ValueError
        If ``path`` is a file, a folder that is not empty and shall not be replaced, or one that cannot give way: the
        working folder, or a place where something is mounted; or if it changed while the block ran.
    OSError
        If the disk is full; the message names the path.
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
    """Put ``new`` where ``path`` is, if that is as it was; a folder that gives way is ``old`` for a moment."""
    if before:
        old.parent.mkdir()
        with contextlib.suppress(FileNotFoundError):  # whoever removed it meanwhile does not want it back
            os.rename(path, old)
    try:
        if old.exists() and _contents(old) != before:
            raise ValueError(_changed(path))
        os.rename(new, path)  # onto nothing or an empty folder: the system refuses any other
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
    """Every file under a folder: which it is, its size, and when it changed; empty if there is no folder."""
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
    """A YAML file: a path as it is, a bare word as the file of that name in a folder of the package.

    Raises
    ------
    ValueError
        If it is a bare word, and there is none of that name.
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
