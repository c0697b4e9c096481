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
        temporary = Path(folder) / path.name
        yield temporary
        os.replace(temporary, path)
