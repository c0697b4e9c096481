"""Files and folders that are either whole or as they were."""

import os
from pathlib import Path

import pytest

from meshot.files import whole_file, whole_folder


def fill(path, replace=False, error=None):
    with whole_folder(path, replace) as temporary:
        assert temporary.name == path.name
        (temporary / "a").write_text("new")
        if error:
            raise error


def test_a_folder_is_whole_or_absent(tmp_path):
    path = tmp_path / "deep" / "out"
    with pytest.raises(RuntimeError):
        fill(path, error=RuntimeError())
    assert list(path.parent.iterdir()) == []
    fill(path)
    assert (path / "a").read_text() == "new"
    assert list(path.parent.iterdir()) == [path]


def test_an_empty_folder_is_filled(tmp_path):
    (tmp_path / "out").mkdir()
    fill(tmp_path / "out")
    assert (tmp_path / "out" / "a").exists()


def test_what_is_there_is_replaced_only_if_asked_and_only_when_all_is_done(tmp_path):
    path = tmp_path / "out"
    path.mkdir()
    (path / "old").write_text("old")
    with pytest.raises(ValueError, match="exists and is not empty"):
        fill(path)
    with pytest.raises(KeyboardInterrupt):
        fill(path, replace=True, error=KeyboardInterrupt())
    assert [f.name for f in path.iterdir()] == ["old"]
    fill(path, replace=True)
    assert [f.name for f in path.iterdir()] == ["a"]
    assert list(tmp_path.iterdir()) == [path]


def test_the_working_folder_and_mounts_are_refused_before_anything_is_done(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for path in (".", str(tmp_path), "../" + tmp_path.name):
        with pytest.raises(ValueError, match="cannot be exchanged for another; name a folder in it"):
            whole_folder(path, replace=True).__enter__()
    with pytest.raises(ValueError, match="something is mounted"):
        whole_folder("/proc", replace=True).__enter__()


def test_what_was_there_comes_back_where_the_new_one_cannot_take_its_place(tmp_path, monkeypatch):
    fill(tmp_path / "out")
    (tmp_path / "out" / "a").write_text("old")
    usual = os.replace

    def replace(source, target):
        if "new" in Path(source).parts:
            raise OSError("no room")
        usual(source, target)

    monkeypatch.setattr(os, "replace", replace)
    with pytest.raises(OSError, match="no room"):
        fill(tmp_path / "out", replace=True)
    assert (tmp_path / "out" / "a").read_text() == "old"
    assert list(tmp_path.iterdir()) == [tmp_path / "out"]


def test_a_file_in_the_way_is_named(tmp_path):
    (tmp_path / "out").write_text("file")
    with pytest.raises(ValueError, match="is a file; a folder is needed"):
        fill(tmp_path / "out", replace=True)


def test_a_file_can_be_read_by_whom_the_umask_says_whoever_wrote_it(tmp_path):
    (tmp_path / "usual").touch()
    with whole_file(tmp_path / "out") as temporary:
        temporary.write_text("new")
        temporary.chmod(0o600)
    assert (tmp_path / "out").read_text() == "new"
    assert (tmp_path / "out").stat().st_mode == (tmp_path / "usual").stat().st_mode
    assert len(list(tmp_path.iterdir())) == 2
