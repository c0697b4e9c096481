"""Settings: groups of values in a YAML file, read once into typed objects. Unknown and invalid settings are errors."""

import dataclasses
import functools
import math
import numbers
import os
import reprlib
import types
import typing
from collections.abc import Callable, Iterable, Mapping, Sequence
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Annotated, Literal, TypeVar

from meshot.errors import require_choice
from meshot.extras import needing

Groups = dict[str, dict]

# The annotations of settings, which say what values are possible.


@dataclasses.dataclass(frozen=True)
class Within:
    """The range of a number, for ``Annotated``. ``ends`` says which ends belong to it, as in mathematics."""

    low: float
    high: float = math.inf
    ends: str = "[]"
    unit: str = ""

    def __contains__(self, value: object) -> bool:
        above = value >= self.low if self.ends[0] == "[" else value > self.low
        return bool(above and (value <= self.high if self.ends[1] == "]" else value < self.high))

    def __str__(self):
        if self.high < math.inf:
            return f" in {self.ends[0]}{self.low}, {self.high}{self.ends[1]}"
        return f" {'>=' if self.ends[0] == '[' else '>'} {self.low}"


def one_of(known: Iterable) -> Callable:
    """One of the known values, for ``Annotated``."""
    return lambda value, name: require_choice(value, name, known) or value


Count, Natural = Annotated[int, Within(1)], Annotated[int, Within(0)]
Positive, NotNegative = Annotated[float, Within(0, ends="()")], Annotated[float, Within(0)]
Length, Share = Annotated[float, Within(0, ends="()", unit="mm")], Annotated[float, Within(0, 1)]


def checked(value: object, kind: object, name: str) -> object:
    """The value of a setting, after a check against its annotation. A list becomes a tuple, a mapping its settings."""
    checks: Sequence = ()
    if typing.get_origin(kind) is Annotated:
        kind, *checks = typing.get_args(kind)
    origin, parts, needed = typing.get_origin(kind), typing.get_args(kind), ""
    if types.NoneType in parts:
        (kind,) = (part for part in parts if part is not types.NoneType)
        return None if value is None else checked(value, kind, name)
    if kind in (int, float):
        if kind is int and isinstance(value, float) and value.is_integer():
            value = int(value)  # 3.0 or 1.0e+3, as YAML and other programs write whole numbers
        within = next((check for check in checks if isinstance(check, Within)), None)
        right = isinstance(value, numbers.Integral if kind is int else numbers.Real) and not isinstance(value, bool)
        if not right or not -math.inf < value < math.inf or (within is not None and value not in within):
            unit = f", in {within.unit}" if within is not None and within.unit else ""
            needed = f"{'an integer' if kind is int else 'a finite number'}{within or ''} is needed{unit}"
            if isinstance(value, str) and _is_number(value):
                needed += "; to YAML a number with an exponent has a point and a sign: write 1.0e-4"
    elif kind in (bool, str):
        needed = "" if isinstance(value, kind) else f"{'true or false' if kind is bool else 'a text'} is needed"
    elif origin is Literal:
        require_choice(value, name, parts)
    elif origin in (tuple, Sequence):
        n = len(parts) if origin is tuple and ... not in parts else None
        if not isinstance(value, list | tuple) or n not in (None, len(value)):
            needed = f"a list{'' if n is None else f' of {n}'} is needed"
        else:
            each = parts if n is not None else parts[:1] * len(value)
            value = tuple(checked(item, part, name) for item, part in zip(value, each))
    elif _is_group(kind):
        value = kind.read(value, "")
    if needed:
        raise ValueError(f"{name} is {reprlib.repr(value)}; {needed}")
    for check in checks:
        value = check(value, name) if callable(check) else value
    return value


def _is_group(kind: object) -> bool:
    return isinstance(kind, type) and issubclass(kind, Settings)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


Read = TypeVar("Read", bound="Settings")


@dataclasses.dataclass(frozen=True)
class Settings:
    """A frozen dataclass of settings, or of groups of settings, which checks its values against their annotations."""

    # Annotations are bool, int, float, str and literals; optional ones; tuples and sequences; other settings; and
    # ``Annotated`` ones with :class:`Within`, or with functions of value and name that return the value or raise.

    def __post_init__(self):
        for name, kind in self.kinds().items():
            object.__setattr__(self, name, checked(getattr(self, name), kind, name))

    @classmethod
    @functools.cache
    def kinds(cls) -> dict[str, object]:
        """The annotations by name."""
        hints = typing.get_type_hints(cls, include_extras=True)
        return {field.name: hints[field.name] for field in dataclasses.fields(cls)}

    @classmethod
    def read(cls: type[Read], content: object, name: str = "the configuration") -> Read:
        """The settings in a mapping, such as the content of a YAML file. Those that are missing have their defaults."""
        if isinstance(content, cls):
            return content
        kinds = cls.kinds()
        groups = {key: kind.kinds() for key, kind in kinds.items() if _is_group(kind)}
        if not isinstance(content, Mapping) or not all(isinstance(content.get(key, {}), Mapping) for key in groups):
            needed = (
                "groups of settings are needed, such as training: {seed: 1}"
                if groups
                else "names and values are needed"
            )
            raise ValueError(f"{name or 'a group'} holds {reprlib.repr(content)}; {needed}")
        strange = [str(key) for key in content if key not in kinds]
        strange += [f"{group}.{key}" for group in groups for key in content.get(group, {}) if key not in groups[group]]
        if strange:
            known = {key: sorted(groups[key]) if key in groups else key for key in kinds} if groups else sorted(kinds)
            raise ValueError(f"{name} sets {', '.join(strange)}, which nothing reads; known are {known}")
        content = {group: {} for group in groups} | dict(content)
        missing = [
            field.name
            for field in dataclasses.fields(cls)
            if field.default is field.default_factory is dataclasses.MISSING and field.name not in content
        ]
        if missing:
            raise ValueError(f"{name} lacks {' and '.join(missing)}; write {', '.join(f'{key}: …' for key in missing)}")
        try:  # checked before the object is made, so that it only ever has values of its annotations
            return cls(**{key: checked(value, kinds[key], key) for key, value in content.items()})
        except ValueError as error:
            raise ValueError(f"{name} is invalid: {error}" if name else str(error)) from error

    def as_dict(self) -> dict:
        """The settings by name, as in a file: groups are mappings, tuples are lists."""
        return {name: _plain(getattr(self, name)) for name in self.kinds()}


def _plain(value: object) -> object:
    if isinstance(value, Settings):
        return value.as_dict()
    return [_plain(item) for item in value] if isinstance(value, tuple) else value


class PartialSettings(Settings):
    """Settings that are None by default, since their defaults are elsewhere, and are then no entries of a file."""

    def as_dict(self) -> dict:
        """Those that are given."""
        return {name: value for name, value in super().as_dict().items() if value is not None}


# Reading of YAML files: plain values only, limited in size, with one type of error for every problem.

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
    with needing("cortex"):  # here, since losses have settings, too, and need no extra
        import yaml

    class Loader(yaml.SafeLoader):
        def compose_node(self, parent: yaml.Node | None, index: object) -> yaml.Node:
            if self.check_event(yaml.AliasEvent):
                raise yaml.composer.ComposerError(None, None, "aliases are not read: write the value out")
            return super().compose_node(parent, index)

    if len(text) > LONGEST:
        raise ValueError(f"it has {len(text)} characters; at most {LONGEST} are read")
    try:
        return yaml.load(text, Loader)
    except (yaml.YAMLError, ValueError) as error:
        raise ValueError(str(error)) from error
    except RecursionError as error:
        raise ValueError("it is nested too deeply") from error


def read_groups(path: str | os.PathLike | Traversable, changes: Sequence[str] = ()) -> Groups:
    """The groups of settings in a YAML file, with some settings changed."""
    # A change has the form ``group.setting=value``, with a value in YAML.
    file = path if isinstance(path, Traversable) else Path(path)
    if not file.is_file():
        raise ValueError(f"{path} does not exist; a YAML file with groups of settings is needed")
    content = read_yaml(file)
    if not isinstance(content, dict) or not all(isinstance(part, dict) for part in content.values()):
        raise ValueError(
            f"{path} holds {reprlib.repr(content)}; groups of settings are needed, such as training: {{seed: 1}}"
        )
    groups = {str(group): part for group, part in content.items()}  # YAML does not read 1 and yes as text
    for change in changes:
        key, equals, value = change.partition("=")
        group, point, setting = key.partition(".")
        if not (equals and group and point and setting):
            raise ValueError(
                f"{change!r} is not a change of a setting; write group.setting=value, such as training.seed=1"
            )
        try:
            groups[group] = groups.get(group, {}) | {setting: parsed_yaml(value)}
        except ValueError as error:
            raise ValueError(f"{change!r}: the value is no YAML ({error})") from error
    return groups
