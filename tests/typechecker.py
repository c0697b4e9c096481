"""The checker of annotations under pytest: beartype, where an int will do for a float."""

import collections
import functools
import inspect
from collections.abc import Callable

import jaxtyping
from beartype import BeartypeConf, beartype

check = beartype(conf=BeartypeConf(is_pep484_tower=True))

#: So many calls of a function are checked in each test: a check takes a tenth of a millisecond and more.
N_CHECKED = 20
calls = collections.Counter()


def lighter(jaxtyped: Callable) -> Callable:
    """The decorator of jaxtyping's import hook for the first calls, and not for functions within functions.

    Those are decorated anew at every call of the outer one, which takes longer than most of them do.
    """

    def chosen(*, typechecker):
        def decorate(thing):
            if "<locals>" in thing.__qualname__:
                return thing
            checked = jaxtyped(thing, typechecker=typechecker)
            if inspect.isclass(thing):
                return checked

            @functools.wraps(thing)
            def called(*args, **kwargs):
                calls[called] += 1
                return (checked if calls[called] <= N_CHECKED else thing)(*args, **kwargs)

            return called

        return decorate

    return chosen


def install(*packages: str) -> None:
    """Check the annotations of all that is imported from now on."""
    jaxtyping.jaxtyped = lighter(jaxtyping.jaxtyped)
    jaxtyping.install_import_hook(packages, "typechecker.check")
