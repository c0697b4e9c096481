"""Reading of YAML files: plain values only, limited in size, with one type of error for every problem."""

import os
from importlib.resources.abc import Traversable
from pathlib import Path

from meshot.extras import needing

with needing("cortex"):
    import yaml

#: Maximum length of a text, in characters.
LONGEST = 1 << 20


def read_yaml(path: str | os.PathLike | Traversable) -> object:
    """The content of a YAML file.

    Raises
    ------
    ValueError
        As :func:`parsed_yaml`, or if the file is not text.
    """
    try:
        file = path if isinstance(path, Traversable) else Path(path)
        return parsed_yaml(file.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(f"{path} cannot be read as plain YAML ({error})") from error


def parsed_yaml(text: str) -> object:
    """The content of a YAML text: numbers, strings, lists and mappings.

    Raises
    ------
    ValueError
        If the text is not YAML, longer than 1 MiB, nested too deeply, or uses aliases (``*name``). Nested aliases can
        expand to more values than fit into memory.
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
