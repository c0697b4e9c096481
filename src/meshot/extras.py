"""Optional libraries: those of the extras ``cortex``, ``bids`` and ``book``."""

import contextlib
import importlib.util
from collections.abc import Iterator


@contextlib.contextmanager
def needing(extra: str) -> Iterator[None]:
    """Wrap the import of an optional library, so that the error says which extra to install."""
    try:
        yield
    except ModuleNotFoundError as error:
        raise ImportError(
            f"{error.name} is not installed, and this part of meshot needs it: pip install 'meshot[{extra}]'"
        ) from error


def is_installed(library: str) -> bool:
    """Whether a library of an extra can be imported."""
    return importlib.util.find_spec(library) is not None
