"""YAML from people: plain values only, of bounded size, and one error for all that can be wrong with it."""

import os
from importlib.resources.abc import Traversable
from pathlib import Path

from meshot.extras import needing

with needing("cortex"):
    import yaml

#: The longest text, in characters, that is parsed.
LONGEST = 1 << 20


def read_yaml(path: str | os.PathLike | Traversable) -> object:
    """What a YAML file says.

    Raises
    ------
    ValueError
        As :func:`parsed_yaml`, or if the file is no text.
    """
    try:
        file = path if isinstance(path, Traversable) else Path(path)
        return parsed_yaml(file.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(f"{path} is no YAML that is read here ({error})") from error


def parsed_yaml(text: str) -> object:
    """What a YAML text says: numbers, words, lists and mappings.

    Raises
    ------
    ValueError
        If it is no YAML, longer than 1 MiB, nested too deeply, or uses aliases (``*name``): a few of them nested make
        more values than any memory holds.
    """
    if len(text) > LONGEST:
        raise ValueError(f"it has {len(text)} characters; at most {LONGEST} are read")
    try:
        return yaml.load(text, _Loader)
    except (yaml.YAMLError, ValueError) as error:
        raise ValueError(str(error)) from error
    except RecursionError as error:
        raise ValueError("it is nested too deeply") from error


class _Loader(yaml.SafeLoader):
    def compose_node(self, parent: yaml.Node | None, index: object) -> yaml.Node:
        if self.check_event(yaml.AliasEvent):
            raise yaml.composer.ComposerError(None, None, "aliases are not read: write the value out")
        return super().compose_node(parent, index)
