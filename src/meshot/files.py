"""Files that are either whole or absent: written to a temporary name, then renamed."""

import contextlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path


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
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=".writing-") as folder:
        temporary, usual = Path(folder) / path.name, Path(folder) / ".usual"
        yield temporary
        # Some writers leave a file that only its owner can read; everybody else's files are as the umask says.
        usual.touch()
        temporary.chmod(usual.stat().st_mode)
        os.replace(temporary, path)


@contextlib.contextmanager
def whole_folder(path: str | os.PathLike, replace: bool = False) -> Iterator[Path]:
    """A temporary folder beside ``path`` that takes its name when the block ends without an error.

    Parameters
    ----------
    path : path
        Where the folder shall be; the one that holds it is made if it is missing.
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
        working folder, or a place where something is mounted.
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
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=".writing-") as place:
        temporary = Path(place) / "new" / path.name
        temporary.mkdir(parents=True)
        yield temporary
        old = Path(place) / "old"
        if path.is_dir():
            os.replace(path, old)
        try:
            os.replace(temporary, path)
        except OSError:
            if old.is_dir():
                os.replace(old, path)
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
