"""Files and folders that are written completely or not at all: first under a temporary name, then renamed."""

import bz2
import contextlib
import errno
import gzip
import io
import os
import platform
import re
import shutil
import tempfile
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

_FULL = (errno.ENOSPC, errno.EDQUOT)
_SAID = re.compile(r"No space left on device|\d+ requested and \d+ written")  # messages of safetensors and numpy
_IN_THE_WAY = (errno.ENOTEMPTY, errno.EEXIST, errno.ENOTDIR)


def printable_name(path: str | os.PathLike) -> str:
    """A path as text that can be printed and stored: bytes that are not valid UTF-8 become U+FFFD."""
    return os.fsencode(path).decode("utf-8", errors="replace")


@contextlib.contextmanager
def whole_file(path: str | os.PathLike) -> Iterator[Path]:
    """Yield a temporary path beside ``path`` that is renamed to ``path`` if the block ends without an error."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    with naming_a_full_disk(path), scratch_folder(path.parent) as folder:
        temporary, usual = folder / path.name, folder / ".usual"
        yield temporary
        # Some writers create files that only the owner can read. Give the file the usual permissions (umask).
        usual.touch()
        temporary.chmod(usual.stat().st_mode)
        os.replace(temporary, path)


def write_whole(path: str | os.PathLike, text: str) -> None:
    """Write a text in UTF-8, completely or not at all."""
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


@contextlib.contextmanager
def whole_folder(path: str | os.PathLike, replace: bool = False) -> Iterator[Path]:
    """Yield a temporary folder beside ``path`` that is renamed to ``path`` if the block ends without an error."""
    # If something else appears at ``path`` while the block runs, it is left as it is, and this call raises. Of two runs
    # that write the same folder, the first to end therefore succeeds.
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
    changed = (
        f"{path} changed while this run was made, perhaps by another run: it is left as it is, and this run is "
        "discarded; choose another folder"
    )
    with naming_a_full_disk(path), scratch_folder(path.parent) as place:
        before = _contents(path)
        new, old = place / "new" / path.name, place / OLD / path.name
        new.mkdir(parents=True)
        yield new
        if before:  # a folder that is replaced is first set aside
            old.parent.mkdir()
            with contextlib.suppress(FileNotFoundError):  # removed meanwhile by someone else
                os.rename(path, old)
        try:
            if old.exists() and _contents(old) != before:
                raise ValueError(changed)
            os.rename(new, path)  # fails unless ``path`` is absent or an empty folder
        except BaseException as error:
            if old.exists():
                try:
                    os.rename(old, path)
                except OSError as taken:
                    kept = Path(tempfile.mkdtemp(prefix=f"{path.name}.before-", dir=path.parent))
                    os.rename(old, kept)
                    raise ValueError(f"{changed}; what was there at the start is in {kept}") from taken
            if getattr(error, "errno", None) in _IN_THE_WAY:
                raise ValueError(changed) from error
            raise


def _contents(folder: Path) -> dict[str, tuple[int, ...]]:
    """Inode, size and time of change of everything under a folder, by relative path; empty if there is no folder."""
    found = {}
    for parent, folders, files in os.walk(folder):
        for name in folders + files:
            state = os.lstat(os.path.join(parent, name))
            key = os.path.relpath(os.path.join(parent, name), folder)
            found[key] = (state.st_ino, state.st_size, state.st_mtime_ns)
    return found


@contextlib.contextmanager
def naming_a_full_disk(path: Path) -> Iterator[None]:
    """Name the disk when it is full: writers say that no space is left, but not where."""
    try:
        yield
    except Exception as error:
        if getattr(error, "errno", None) in _FULL or _SAID.search(str(error)):
            message = f"the disk or quota of {path.parent} is full; make room, or write elsewhere"
            raise OSError(errno.ENOSPC, message, str(path)) from error
        raise


def named_file(name: str | os.PathLike, folder: Path) -> Path:
    """The path of a YAML file: ``name`` itself if it is a path, or the file of that name in a folder of the package."""
    path = Path(name)
    if path.suffix or len(path.parts) != 1:
        return path
    known = sorted(file.stem for file in folder.glob("*.yaml"))
    if path.name not in known:
        raise ValueError(
            f"{path.name} is not known; the package has {', '.join(known)}, or name a file: {path.name}.yaml"
        )
    return folder / f"{path.name}.yaml"


# Reading of gzip and bzip2 files to the end, so that the checksum is verified, up to a maximum size.

_BLOCK = 1 << 20
_OPENERS = {b"\x1f\x8b": gzip.open, b"BZh": bz2.open}


def unpacked(path: str | os.PathLike, largest: int) -> bytes:
    """The content of a file, decompressed to at most ``largest`` bytes if its first bytes mark it as gzip or bzip2."""
    return b"".join(_blocks(Path(path), largest))


def unpacked_size(path: str | os.PathLike, largest: int) -> int:
    """The size in bytes of what :func:`unpacked` returns, without holding it in memory. Raises the same errors."""
    path = Path(path)
    return path.stat().st_size if _opener(path) is open else sum(len(block) for block in _blocks(path, largest))


def _blocks(path: Path, largest: int) -> Iterator[bytes]:
    n_bytes, packed = 0, _opener(path) is not open
    try:
        with opened(path) as file:
            while block := file.read(_BLOCK):
                n_bytes += len(block)
                if packed and n_bytes > largest:
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


# Temporary folders beside the output. Those that killed runs left are removed by later runs.

#: Subfolder in which :func:`meshot.files.whole_folder` keeps a replaced folder during the exchange.
OLD = "old"
_LOCK = ".lock"


@contextlib.contextmanager
def scratch_folder(parent: Path) -> Iterator[Path]:
    """Yield a temporary folder in ``parent`` and remove it at the end. Folders left by killed runs are removed first.

    A file in the folder is locked while its process lives, and the name of the folder contains that of the machine. A
    folder is removed only if it was made on this machine and its lock is free.
    """
    from filelock import FileLock  # its import takes as long as that of this package

    remove_abandoned(parent)
    while True:
        folder = Path(tempfile.mkdtemp(prefix=_prefix(), dir=parent))
        lock = FileLock(folder / _LOCK)
        with contextlib.suppress(OSError, NotImplementedError):  # file systems without locks: nothing is removed there
            lock.acquire()
        if folder.is_dir():
            break
        lock.release()  # another run removed the folder before it was locked
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        lock.release()


def remove_abandoned(parent: Path) -> None:
    """Remove the temporary folders in ``parent`` whose process has ended. Folders set aside in them are restored."""
    from filelock import FileLock

    for folder in parent.glob(f"{_prefix()}*"):
        with contextlib.suppress(OSError, NotImplementedError), FileLock(folder / _LOCK, timeout=0):
            for old in (folder / OLD).glob("*"):  # the process was killed between two renames
                if not (parent / old.name).exists():
                    old.rename(parent / old.name)
            shutil.rmtree(folder, ignore_errors=True)


def _prefix() -> str:
    return f".writing-{re.sub(r'[^A-Za-z0-9]', '', platform.node())}-"
