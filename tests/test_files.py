"""Files and folders that are either whole or as they were."""

import errno
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from meshot.files import remove_abandoned, whole_file, whole_folder


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
    assert (path / "a").read_text(encoding="utf-8") == "new"
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
    usual = os.rename

    def rename(source, target):
        if "new" in Path(source).parts:
            raise OSError("no room")
        usual(source, target)

    monkeypatch.setattr(os, "rename", rename)
    with pytest.raises(OSError, match="no room"):
        fill(tmp_path / "out", replace=True)
    assert (tmp_path / "out" / "a").read_text(encoding="utf-8") == "old"
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
    assert (tmp_path / "out").read_text(encoding="utf-8") == "new"
    assert (tmp_path / "out").stat().st_mode == (tmp_path / "usual").stat().st_mode
    assert len(list(tmp_path.iterdir())) == 2


def holding(path):
    """What a folder holds, or what a file says."""
    return sorted(f.name for f in path.iterdir()) if path.is_dir() else path.read_text(encoding="utf-8")


def make_file(path):
    path.write_text("theirs")


def make_folder(path):
    path.mkdir(exist_ok=True)
    (path / "theirs").write_text("theirs")


@pytest.mark.parametrize("appear", [make_file, make_folder])
@pytest.mark.parametrize("replace", [False, True])
def test_what_appeared_meanwhile_is_left_as_it_is(tmp_path, appear, replace):
    path = tmp_path / "out"

    def write():
        with whole_folder(path, replace) as temporary:
            (temporary / "a").write_text("new")
            appear(path)

    with pytest.raises(ValueError, match=r"changed while this run was made.*left as it is.*choose another folder"):
        write()
    assert holding(path) in ("theirs", ["theirs"])
    assert list(tmp_path.iterdir()) == [path]


def test_of_two_runs_the_first_to_end_wins(tmp_path):
    path = tmp_path / "out"

    def second():
        with whole_folder(path) as temporary:
            (temporary / "second").touch()
            with whole_folder(path) as other:
                (other / "first").touch()

    with pytest.raises(ValueError, match="perhaps by another run"):
        second()
    assert holding(path) == ["first"]
    assert list(tmp_path.iterdir()) == [path]


def added(path):
    (path / "more").write_text("theirs")


def edited(path):
    (path / "a").write_text("theirs, and longer")


def replaced(path):
    fill(path, replace=True)


def turned_into_a_file(path):
    path.rename(path.with_name("elsewhere"))
    path.write_text("theirs")


@pytest.mark.parametrize("change", [added, edited, replaced, turned_into_a_file])
def test_only_what_was_there_at_the_start_is_replaced(tmp_path, change):
    path = tmp_path / "out"
    fill(path)

    def write():
        with whole_folder(path, replace=True) as temporary:
            (temporary / "b").write_text("ours")
            change(path)
            seen.append(holding(path))

    seen = []
    with pytest.raises(ValueError, match="changed while this run was made"):
        write()
    assert holding(path) == seen[0]
    assert not list(tmp_path.glob(".writing-*"))


def test_a_folder_that_was_removed_meanwhile_is_written(tmp_path):
    fill(tmp_path / "out")
    with whole_folder(tmp_path / "out", replace=True) as temporary:
        (temporary / "b").touch()
        shutil.rmtree(tmp_path / "out")
    assert holding(tmp_path / "out") == ["b"]


def test_what_can_not_come_back_is_kept_under_another_name(tmp_path, monkeypatch):
    """Somebody takes the name in the moment between the two renames."""
    path, usual = tmp_path / "out", os.rename
    fill(path)

    def rename(source, target):
        usual(source, target)
        if Path(source) == path:
            make_folder(path)

    monkeypatch.setattr(os, "rename", rename)
    with pytest.raises(ValueError, match=r"what was there at the start is in .*out\.before-"):
        fill(path, replace=True)
    (kept,) = tmp_path.glob("out.before-*")
    assert (holding(path), holding(kept)) == (["theirs"], ["a"])


def test_a_link_is_followed(tmp_path):
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to("real")
    with whole_folder(tmp_path / "link") as temporary:
        (temporary / "a").touch()
    assert holding(tmp_path / "real") == ["a"]
    assert (tmp_path / "link").is_symlink()


KILLED = """
import os, signal, sys
from meshot.files import whole_file, whole_folder
with {call} as temporary:
    {inside}
    os.kill(os.getpid(), signal.SIGKILL)
"""


def kill(call, inside):
    done = subprocess.run([sys.executable, "-c", KILLED.format(call=call, inside=inside)], check=False)
    assert done.returncode == -signal.SIGKILL


@pytest.mark.parametrize("call", ["whole_folder({!r})", "whole_file({!r})"])
def test_what_a_kill_left_is_removed_by_the_next_run(tmp_path, call):
    kill(call.format(str(tmp_path / "out")), "print(temporary)")
    assert len(list(tmp_path.glob(".writing-*"))) == 1
    with whole_file(tmp_path / "other") as temporary:
        temporary.touch()
    assert holding(tmp_path) == ["other"]


def test_what_was_set_aside_by_a_run_killed_between_two_renames_comes_back(tmp_path):
    path = tmp_path / "out"
    fill(path)
    aside = f"old = temporary.parent.parent / 'old'; old.mkdir(); os.rename({str(path)!r}, old / 'out')"
    kill(f"whole_folder({str(path)!r}, True)", aside)
    assert not path.exists()
    remove_abandoned(tmp_path)
    assert holding(path) == ["a"]
    assert list(tmp_path.iterdir()) == [path]


def test_what_a_living_run_writes_is_not_removed(tmp_path):
    wait = f"with whole_file({str(tmp_path / 'slow')!r}) as t: print(flush=True); input(); t.write_text('whole')"
    code = f"from meshot.files import whole_file\n{wait}"
    with subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other:
        other.stdout.readline()
        with whole_file(tmp_path / "fast") as temporary:
            temporary.touch()
        assert len(list(tmp_path.glob(".writing-*"))) == 1
        other.communicate(b"\n")
    assert (tmp_path / "slow").read_text(encoding="utf-8") == "whole"
    assert holding(tmp_path) == ["fast", "slow"]


def test_what_another_machine_left_is_not_touched(tmp_path):
    (tmp_path / ".writing-anotherone-abc").mkdir()
    remove_abandoned(tmp_path)
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize(
    "error",
    [
        OSError(errno.ENOSPC, "No space left on device"),
        RuntimeError("I/O error: No space left on device (os error 28)"),  # what safetensors says
        OSError("245760 requested and 139250 written"),  # what numpy says
    ],
)
@pytest.mark.parametrize("whole", [whole_file, whole_folder])
def test_a_full_disk_is_named(tmp_path, whole, error):
    def write():
        with whole(tmp_path / "out"):
            raise error

    with pytest.raises(OSError, match=rf"the disk or quota of {tmp_path} is full; make room.*out") as caught:
        write()
    assert caught.value.errno == errno.ENOSPC
    assert list(tmp_path.iterdir()) == []
