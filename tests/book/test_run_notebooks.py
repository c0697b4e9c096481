"""Notebooks that run side by side: the longest first, and the first failure ends the run with its words."""

import subprocess
import threading

import pytest

import run_notebooks
from meshot_book.notebook.environment import stated_seconds


@pytest.fixture
def chapters(monkeypatch, tmp_path):
    """Five sources with the seconds that they took; the names in the order in which they were run."""
    for name, seconds in (("01_a", 5), ("02_b", 50), ("03_c", 20), ("04_d", 1), ("05_e", 30)):
        (tmp_path / f"{name}.md").write_text("# A\n")
        (tmp_path / f"{name}.ipynb").write_text(f"CPU; seed 0; ran in {seconds} s")
    monkeypatch.setattr(run_notebooks, "NOTEBOOKS", tmp_path)
    monkeypatch.setattr(run_notebooks.os, "cpu_count", lambda: 1)
    ran, failing, lock = [], set(), threading.Lock()

    def alone(source):
        with lock:
            ran.append(source.stem)
        said = f"{source.stem} failed:\nNameError" if source.stem in failing else f"{source.stem}: 1 s\n"
        return subprocess.CompletedProcess([], int(source.stem in failing), said)

    monkeypatch.setattr(run_notebooks, "_run_alone", alone)
    return ran, failing


def test_all_are_run_the_longest_first(chapters):
    ran, _ = chapters
    assert run_notebooks.main(["fresh"]) == 0
    assert ran == ["02_b", "05_e", "03_c", "01_a", "04_d"]


def test_a_failure_is_said_and_the_rest_is_left_out(chapters, capsys):
    ran, failing = chapters
    failing.add("02_b")
    assert run_notebooks.main(["fresh"]) == 1
    assert "02_b failed:\nNameError" in capsys.readouterr().out
    assert len(ran) < 5


def test_seconds_are_those_of_all_cards():
    assert stated_seconds("seed 0; ran in 12 s\nseed 1; ran in 30 s") == 42
    assert stated_seconds("nothing was run") == 0
