"""What is refused with a ValueError, in one line."""

from collections.abc import Callable

import pytest


def refuses(words: str, call: Callable, *given: object, **named: object) -> None:
    """Check that a call ends with a ValueError whose text matches."""
    with pytest.raises(ValueError, match=words):
        call(*given, **named)
