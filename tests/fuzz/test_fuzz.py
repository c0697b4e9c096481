"""A sample of damaged files: each is read or refused with a clear error, within 2 s and 1 GiB."""

import fuzz_trial
import numpy as np
import pytest
from fuzz_seeds import KINDS, whole


def test_a_sample_of_damaged_files():
    """Every kind of file about ten times; ``make fuzz`` reads 5000."""
    assert dict(fuzz_trial.trials(range(300))) == {}


@pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("name", KINDS)
def test_whole_files_are_read(tmp_path, name):
    (tmp_path / name).write_bytes(whole(name))
    KINDS[name][1](tmp_path / name)


def test_a_number_makes_the_same_file_again():
    assert fuzz_trial.content_of(7) == fuzz_trial.content_of(7)


def failing(error):
    def read(path):
        raise error

    return read


def grasping(path):
    try:
        np.ones(1 << 56)
    except MemoryError as error:
        raise ValueError("refused, but only by the system") from error


@pytest.mark.parametrize(
    ("read", "said"),
    [
        (failing(ValueError("no")), ""),
        (failing(OSError("no")), ""),
        (failing(KeyError("lost")), "KeyError"),
        (grasping, "more than 1 GiB wanted"),
        (lambda path: sum(range(10**6)), " s"),
    ],
)
def test_what_the_trial_says_of_a_reader(tmp_path, monkeypatch, read, said):
    monkeypatch.setitem(KINDS, "text.ply", (KINDS["text.ply"][0], read))
    monkeypatch.setattr(fuzz_trial, "SECONDS", 0.001 if said == " s" else 2.0)
    found = fuzz_trial.verdict(0, tmp_path)
    assert said in found
    assert bool(found) == bool(said)
