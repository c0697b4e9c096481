"""Settings: groups in a file, changes from the command line, typed objects, and what is said of wrong ones."""

import dataclasses
from collections.abc import Sequence
from typing import Annotated, Literal

import numpy as np
import pytest

from meshot.settings import Count, Length, NotNegative, Settings, Within, one_of, read_groups
from refusals import refuses


@dataclasses.dataclass(frozen=True)
class One(Settings):
    """A group with every kind of setting."""

    n: Count
    size: Annotated[int, Within(1, 15, "[)")] = 3
    length: Length | None = None
    weight: NotNegative = 0.5
    kind: Annotated[str, one_of(("a", "b"))] = "a"
    way: Literal["up", "down"] = "up"
    on: bool = False
    pair: tuple[float, float] = (0.0, 1.0)
    widths: Sequence[Count] = (1,)
    name: str = ""


@dataclasses.dataclass(frozen=True)
class Both(Settings):
    """Two groups."""

    one: One
    other: "Other"


@dataclasses.dataclass(frozen=True)
class Other(Settings):
    """A group whose settings have defaults."""

    rate: float = 1.0


def test_a_mapping_becomes_an_object_and_comes_back():
    found = Both.read({"one": {"n": 2, "pair": [1, 2.5], "widths": [3, 4], "length": 2}})
    assert found == Both(One(2, length=2, pair=(1, 2.5), widths=(3, 4)), Other())
    assert Both.read(found) is found
    again = found.as_dict()
    assert (again["one"]["pair"], again["one"]["widths"], again["other"]) == ([1, 2.5], [3, 4], {"rate": 1.0})
    assert Both.read(again) == found
    assert One(np.int64(3)).n == 3
    assert isinstance(One.read({"n": 1.0e3, "length": 2}).n, int)  # whole, as YAML writes it with an exponent
    assert hash(found) == hash(Both.read(again))


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"n": 0}, "n is 0; an integer >= 1 is needed"),
        ({"n": True}, "n is True; an integer >= 1 is needed"),
        ({"n": 1.5}, "n is 1.5; an integer >= 1 is needed"),
        ({"size": 15}, "size is 15; an integer in [1, 15) is needed"),
        ({"length": 0.0}, "length is 0.0; a finite number > 0 is needed, in mm"),
        ({"weight": float("nan")}, "weight is nan; a finite number >= 0 is needed"),
        ({"weight": float("inf")}, "weight is inf; a finite number >= 0 is needed"),
        ({"weight": "1e-4"}, "weight is '1e-4'; a finite number >= 0 is needed; to YAML a number with an exponent has"),
        ({"kind": "c"}, "kind is 'c'; one of a, b is needed"),
        ({"kind": 3}, "kind is 3; a text is needed"),
        ({"way": "left"}, "way is 'left'; one of up, down is needed"),
        ({"on": 1}, "on is 1; true or false is needed"),
        ({"pair": [1]}, "pair is [1]; a list of 2 is needed"),
        ({"pair": [1, "x"]}, "pair is 'x'; a finite number is needed"),
        ({"widths": 3}, "widths is 3; a list is needed"),
        ({"widths": [0]}, "widths is 0; an integer >= 1 is needed"),
        ({"name": None}, "name is None; a text is needed"),
    ],
)
def test_a_value_that_is_not_possible_is_named(settings, words, unchecked):
    with pytest.raises(ValueError) as caught:  # noqa: PT011 (the whole sentence is compared)
        Both.read({"one": {"n": 1} | settings}, "here")
    assert str(caught.value).startswith(f"here is invalid: {words}")
    with pytest.raises(ValueError) as caught:  # noqa: PT011
        One(**{"n": 1} | settings)
    assert str(caught.value).startswith(words)


def test_unknown_and_missing_settings_are_named():
    with pytest.raises(ValueError, match=r"here sets c, one\.four, which nothing reads; known are .*'widths'"):
        Both.read({"c": {}, "one": {"four": 4}}, "here")
    refuses("here lacks n", One.read, {}, "here")
    for content in (["a"], {"one": 3}):
        refuses(r"here holds .*; groups of settings are needed, such as training", Both.read, content, "here")


def test_a_file_is_read_and_changes_replace_and_add(tmp_path):
    path = tmp_path / "c.yaml"
    path.write_text("a: {one: 1}\nb: {}\n")
    assert read_groups(path) == {"a": {"one": 1}, "b": {}}
    found = read_groups(path, ["a.one=[2, 3]", "a.two=word", "b.three=1.5", "c.four=4"])
    assert found == {"a": {"one": [2, 3], "two": "word"}, "b": {"three": 1.5}, "c": {"four": 4}}
    for change in ("a.one", "one=1", "a.=1", ".one=1"):
        refuses(r"is not a change of a setting; write group\.setting=value", read_groups, path, [change])
    refuses("the value is no YAML", read_groups, path, ["a.one=[1"])
    path.write_text("[1]")
    refuses(r"c\.yaml holds \[1\]; groups of settings are needed", read_groups, path)
    path.write_text("a: [")
    refuses(r"c\.yaml cannot be read as plain YAML", read_groups, path)
    refuses(r"none\.yaml does not exist", read_groups, tmp_path / "none.yaml")
