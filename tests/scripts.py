"""Scripts of a folder as modules: experiments and benchmarks import each other by bare names, which they share."""

import contextlib
import importlib
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType


@contextlib.contextmanager
def scripts_in(folder: Path) -> Iterator[Callable[[str], ModuleType]]:
    """How to import the folder's own modules; namesakes of other folders are put aside, and back afterwards."""
    names = [file.stem for file in folder.glob("*.py")]
    others = {name: sys.modules.pop(name) for name in names if name in sys.modules}
    sys.path.insert(0, str(folder))
    importlib.invalidate_caches()
    try:
        yield importlib.import_module
    finally:
        sys.path.remove(str(folder))
        for name in names:
            sys.modules.pop(name, None)
        sys.modules.update(others)
