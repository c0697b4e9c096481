"""Compilation of kernels by numba: on first call, cached on disk, and announced on standard error."""

import inspect
import sys
from collections.abc import Callable
from typing import Any

from numba import njit
from numba.core import event

_announcements: dict[object, str] = {}  # message of each kernel; removed once it has been printed
_lost: list[str] = []  # kernels that cannot be cached on disk


_NOWHERE = "no folder to keep them in can be written to: set NUMBA_CACHE_DIR to one"


def kernel(purpose: str, seconds: int, **options: Any) -> Callable[[Callable], Any]:
    """Decorate a function so that numba compiles it on its first call and caches the result on disk."""
    # The cache is in ``__pycache__`` beside the source file, or in the user's cache if the package folder is not
    # writable, or in ``NUMBA_CACHE_DIR``. If none of these is writable, every process compiles the function again. The
    # compiled function releases the GIL.
    options = {"nogil": True} | options

    def compiled(function: Callable) -> Any:
        plain = inspect.unwrap(function)
        try:
            found, said = njit(cache=True, **options)(plain), f"once; about {seconds} s"
        except RuntimeError:  # numba raises this if it finds no writable folder
            found, said = njit(**options)(plain), f"about {seconds} s in every process; {_NOWHERE}"
            _lost.append(function.__qualname__)
        _announcements[found] = f"meshot: compiling the kernels of {purpose}, {said}"
        return found

    return compiled


def inner(**options: Any) -> Callable[[Callable], Any]:
    """Decorate a function that only other kernels call."""
    # Without wrappers for Python and C it compiles in half the time. The test suite wraps every function in type
    # checks, which numba cannot compile: unwrap takes them off.
    options = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True} | options
    return lambda function: njit(**options)(inspect.unwrap(function))


def require_kept() -> None:
    """Check that all kernels imported so far can be cached on disk."""
    if _lost:
        raise ValueError(f"compiled kernels are lost when the process ends; {_NOWHERE}")


class _Announcing(event.Listener):
    def on_start(self, event: event.Event) -> None:
        said = _announcements.get(event.data["dispatcher"])
        if said is None:
            return
        for each in [each for each, its in _announcements.items() if its == said]:
            del _announcements[each]
        print(said, file=sys.stderr, flush=True)

    def on_end(self, event: event.Event) -> None:
        pass


event.register("numba:compile", _Announcing())
