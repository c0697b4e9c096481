"""How kernels are compiled by numba: when first called, kept for the next process, and announced."""

import sys
from collections.abc import Callable
from typing import Any, no_type_check

from numba import njit
from numba.core import event

#: Options of what only kernels call: without what Python and C would call it by, it compiles in half the time.
INNER = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
_announcements: dict[object, str] = {}  # by kernel; taken out of here when it is made
_lost: list[str] = []  # kernels that cannot be kept


_NOWHERE = "no folder to keep them in can be written to: set NUMBA_CACHE_DIR to one"


def kernel(purpose: str, seconds: int, **options: Any) -> Callable[[Callable], Any]:
    """A decorator: a function that numba compiles when it is first called, and keeps for later processes.

    It is kept in ``__pycache__`` beside its source, or in the user's cache where the package cannot be written to, or
    in ``NUMBA_CACHE_DIR``; where none of these can be written to, every process compiles it anew. It releases the GIL.

    Parameters
    ----------
    purpose : str
        What its kernels are for, such as "the sliced loss"; a process announces each purpose once, on stderr.
    seconds : int
        About how long it takes to compile all kernels of that purpose.
    options
        Of ``numba.njit``.
    """
    options = {"nogil": True} | options

    @no_type_check  # numba's objects
    def compiled(function):
        try:
            found, said = njit(cache=True, **options)(function), f"once; about {seconds} s"
        except RuntimeError:  # what numba raises if it finds no folder
            found, said = njit(**options)(function), f"about {seconds} s in every process; {_NOWHERE}"
            _lost.append(function.__qualname__)
        _announcements[found] = f"meshot: compiling the kernels of {purpose}, {said}"
        return found

    return compiled


def require_kept() -> None:
    """Require that the kernels that were imported so far are kept once they are compiled.

    Raises
    ------
    ValueError
        If there is no folder for them.
    """
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
