"""Files that hold a JSON object."""

import json
from pathlib import Path


def json_of(file: Path) -> dict:
    """The JSON object in a file.

    Parameters
    ----------
    file : pathlib.Path

    Raises
    ------
    ValueError
        If it is not UTF-8, not JSON, or no object.
    """
    try:
        found = json.loads(file.read_text(encoding="utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{file} is not JSON in UTF-8 ({error}); mend it") from error
    if not isinstance(found, dict):
        raise ValueError(f"{file} holds a {type(found).__name__}; a JSON object, {{...}}, is needed: mend it")
    return found
