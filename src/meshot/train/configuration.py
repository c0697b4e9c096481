"""Configurations: groups of settings in a YAML file, of which every one is read by something."""

import dataclasses
import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from meshot.extras import needing

with needing("cortex"):
    import yaml


Groups = dict[str, dict]


def read_groups(path: str | os.PathLike, known: Mapping[str, set[str]]) -> Groups:
    """The groups of settings in a YAML file; a group that is left out is empty.

    Parameters
    ----------
    path : path
    known : mapping
        The settings of each group that something reads.

    Raises
    ------
    ValueError
        If the file is missing or no YAML, or names something unknown.
    """
    path = Path(path)
    if not path.is_file():
        raise ValueError(f"{path} does not exist; a YAML file with groups of settings is needed")
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
    except yaml.YAMLError as error:
        raise ValueError(f"{path} is no YAML ({error})") from error
    return checked_groups(content, known, str(path))


def checked_groups(content: object, known: Mapping[str, set[str]], name: str) -> Groups:
    """Groups of settings as they stand in a YAML file, each with every known group.

    Raises
    ------
    ValueError
        If they are no groups, or name something unknown.
    """
    if not isinstance(content, dict) or not all(isinstance(part, dict) for part in content.values()):
        raise ValueError(f"{name} holds {content!r}; groups of settings are needed: {', '.join(known)}")
    strange = [key for key in content if key not in known]
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


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def changed_groups(groups: Groups, changes: Sequence[str]) -> Groups:
    """The groups with some settings changed, each named as ``group.setting=value``, the value in YAML.

    Raises
    ------
    ValueError
        If a change is not of this form.
    """
    found = {group: dict(settings) for group, settings in groups.items()}
    for change in changes:
        key, equals, value = change.partition("=")
        group, point, setting = key.partition(".")
        if not (equals and group and point and setting):
            raise ValueError(f"{change!r} changes nothing; write group.setting=value, such as training.seed=1")
        try:
            found.setdefault(group, {})[setting] = yaml.safe_load(value)
        except yaml.YAMLError as error:
            raise ValueError(f"{change!r}: the value is no YAML ({error})") from error
    return found


def setting_names(kind: type) -> set[str]:
    """The fields of a dataclass of settings."""
    return {field.name for field in dataclasses.fields(kind)}
