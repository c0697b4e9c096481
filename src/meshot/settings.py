"""Configurations: groups of settings in a YAML file. Unknown settings are errors."""

import dataclasses
import os
import reprlib
from collections.abc import Mapping, Sequence
from importlib.resources.abc import Traversable
from pathlib import Path

from meshot.extras import needing

Groups = dict[str, dict]


def read_groups(path: str | os.PathLike | Traversable) -> Groups:
    """Read the groups of settings in a YAML file, with any names: see :func:`meshot.settings.checked_groups`."""
    file = path if isinstance(path, Traversable) else Path(path)
    if not file.is_file():
        raise ValueError(f"{path} does not exist; a YAML file with groups of settings is needed")
    return _require_groups(read_yaml(file), str(path))


def checked_groups(content: object, known: Mapping[str, set[str]], name: str) -> Groups:
    """The groups of settings, checked against the known names. Missing groups are added empty."""
    content = _require_groups(content, name)
    strange = [str(key) for key in content if key not in known]
    strange += [f"{group}.{key}" for group in known for key in content.get(group, {}) if key not in known[group]]
    if strange:
        raise ValueError(f"{name} sets {', '.join(strange)}, which nothing reads; known are {dict(known)}")
    for group, settings in content.items():
        for key, value in settings.items():
            if isinstance(value, str) and _is_number(value):
                raise ValueError(
                    f"{group}.{key} in {name} is the text {value!r}; to YAML a number with an exponent has a point and "
                    "a sign: write 1.0e-4"
                )
    return {group: dict(content.get(group, {})) for group in known}


def _require_groups(content: object, name: str) -> Groups:
    if not isinstance(content, dict) or not all(isinstance(part, dict) for part in content.values()):
        raise ValueError(
            f"{name} holds {reprlib.repr(content)}; groups of settings are needed, such as training: {{seed: 1}}"
        )
    return {str(group): part for group, part in content.items()}  # YAML does not read 1 and yes as text


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def changed_groups(groups: Groups, changes: Sequence[str]) -> Groups:
    """The groups with some settings changed. A change has the form ``group.setting=value``, with a value in YAML."""
    found = {group: dict(settings) for group, settings in groups.items()}
    for change in changes:
        key, equals, value = change.partition("=")
        group, point, setting = key.partition(".")
        if not (equals and group and point and setting):
            raise ValueError(
                f"{change!r} is not a change of a setting; write group.setting=value, such as training.seed=1"
            )
        try:
            found.setdefault(group, {})[setting] = parsed_yaml(value)
        except ValueError as error:
            raise ValueError(f"{change!r}: the value is no YAML ({error})") from error
    return found


def setting_names(kind: type) -> set[str]:
    """The names of the fields of a settings dataclass."""
    return {field.name for field in dataclasses.fields(kind)}


# Reading of YAML files: plain values only, limited in size, with one type of error for every problem.

with needing("cortex"):
    import yaml

#: Maximum length of a text, in characters.
LONGEST = 1 << 20


def read_yaml(path: str | os.PathLike | Traversable) -> object:
    """The content of a YAML file."""
    try:
        file = path if isinstance(path, Traversable) else Path(path)
        return parsed_yaml(file.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(f"{path} cannot be read as plain YAML ({error})") from error


def parsed_yaml(text: str) -> object:
    """The content of a YAML text: numbers, strings, lists and mappings."""
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
