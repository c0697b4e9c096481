"""Trainings in turn and in several processes: failures are named, folders are locked, output is kept."""

import platform
import sys

import pytest
import torch

from meshot_book.trainings import processes

#: A training that fails if its name begins with "bad".
COMMAND = "import sys; name = sys.argv[-1]; print('made', name); sys.exit(name.startswith('bad'))"


def test_a_training_that_fails_does_not_stop_those_after_it(capsys):
    begun = []

    def train_one(name):
        begun.append(name)
        if name != "third":
            raise {"first": ValueError, "second": processes.Busy}[name](f"{name} cannot be made")

    assert processes.train_in_turn(["first", "second", "third"], train_one) == ["first", "second"]
    assert begun == ["first", "second", "third"]
    said = capsys.readouterr().err
    assert "first (1 of 3)\nfirst cannot be made\nsecond (2 of 3)\nsecond cannot be made\nthird (3 of 3)" in said


def test_other_errors_end_the_run():
    with pytest.raises(ZeroDivisionError):
        processes.train_in_turn(["a"], lambda name: 1 / 0)


def test_processes_are_named_when_they_fail_and_their_output_is_kept(tmp_path, monkeypatch):
    monkeypatch.setattr(processes, "SECONDS_BETWEEN_LOOKS", 0.05)
    names = ["good", "bad", "better"]
    command = [sys.executable, "-c", COMMAND]
    assert processes.train_in_processes({name: tmp_path / name for name in names}, command, 2) == ["bad"]
    for name in names:
        assert (tmp_path / name / processes.OUTPUT).read_text(encoding="utf-8") == f"made {name}\n"


#: Fills 50 MB ten times, and prints how many pages of memory were new after the first time.
FILLS = """
import resource, numpy as np
new = lambda: resource.getrusage(resource.RUSAGE_SELF).ru_minflt
np.ones(6_250_000)
before = new()
for _ in range(10):
    np.ones(6_250_000)
print(new() - before)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="a setting of glibc")
def test_freed_memory_is_used_again(tmp_path, monkeypatch):
    monkeypatch.setattr(processes, "SECONDS_BETWEEN_LOOKS", 0.05)
    assert processes.train_in_processes({"one": tmp_path}, [sys.executable, "-c", FILLS], 1) == []
    assert int((tmp_path / processes.OUTPUT).read_text(encoding="utf-8")) < 1000  # each time would be 12 208 pages


def test_a_folder_is_locked_against_others(tmp_path):
    with processes.alone(tmp_path / "one"):
        with (
            pytest.raises(processes.Busy, match="one is being trained by another process"),
            processes.alone(tmp_path / "one"),
        ):
            pass
        with processes.alone(tmp_path / "two"):
            pass
    with processes.alone(tmp_path / "one"):
        pass


def test_a_gpu_that_is_not_there_is_refused(monkeypatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    processes.require_device("cpu")
    with pytest.raises(ValueError, match="--device is cuda:1, and no such device is here: leave it out"):
        processes.require_device("cuda:1")
