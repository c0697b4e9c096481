"""Groups of settings: read, checked, and changed from the command line."""

import pytest

from meshot.settings import changed_groups, checked_groups, read_groups

KNOWN = {"a": {"one", "two"}, "b": {"three"}}


def test_groups_are_read_and_missing_ones_are_empty(tmp_path):
    path = tmp_path / "c.yaml"
    path.write_text("a: {one: 1}\n")
    assert checked_groups(read_groups(path), KNOWN, "here") == {"a": {"one": 1}, "b": {}}
    path.write_text("[1]")
    with pytest.raises(ValueError, match=r"c\.yaml holds \[1\]; groups of settings are needed"):
        read_groups(path)
    path.write_text("a: [")
    with pytest.raises(ValueError, match=r"c\.yaml cannot be read as plain YAML"):
        read_groups(path)
    with pytest.raises(ValueError, match=r"none\.yaml does not exist"):
        read_groups(tmp_path / "none.yaml")


def test_changes_replace_and_add():
    groups = {"a": {"one": 1}, "b": {}}
    found = changed_groups(groups, ["a.one=[2, 3]", "a.two=word", "b.three=1.5"])
    assert found == {"a": {"one": [2, 3], "two": "word"}, "b": {"three": 1.5}}
    assert groups == {"a": {"one": 1}, "b": {}}


@pytest.mark.parametrize("change", ["a.one", "one=1", "a.=1", ".one=1"])
def test_a_change_without_group_name_or_value_is_refused(change):
    with pytest.raises(ValueError, match=r"is not a change of a setting; write group\.setting=value"):
        changed_groups({"a": {}}, [change])


def test_a_value_that_is_no_yaml_is_refused():
    with pytest.raises(ValueError, match="the value is no YAML"):
        changed_groups({"a": {}}, ["a.one=[1"])


def test_unknown_groups_and_settings_are_named():
    with pytest.raises(ValueError, match=r"here sets c, a\.four, which nothing reads"):
        checked_groups({"c": {}, "a": {"four": 4}}, KNOWN, "here")
    with pytest.raises(ValueError, match="groups of settings are needed"):
        checked_groups(["a"], KNOWN, "here")


def test_a_number_that_yaml_takes_for_text_is_refused_by_name():
    groups = changed_groups({"a": {}}, ["a.one=1e-4"])
    with pytest.raises(ValueError, match=r"a\.one in here is the text '1e-4'; .* write 1\.0e-4"):
        checked_groups(groups, KNOWN, "here")
    assert checked_groups(changed_groups({"a": {}}, ["a.one=1.0e-4"]), KNOWN, "here")["a"] == {"one": 1e-4}
