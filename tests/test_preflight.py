"""What is missing is said in one line with its remedy, and stops make before anything crashes."""

import subprocess
import sys
from types import SimpleNamespace

import pytest

import preflight


def test_nothing_is_missing_here():
    assert preflight.main(["python", "display", "browser"]) == 0


def test_an_old_python_is_named(monkeypatch, capsys):
    monkeypatch.setattr(preflight.sys, "version_info", (3, 9, 2, "final", 0))
    assert preflight.main(["python"]) == 1
    (line,) = capsys.readouterr().out.splitlines()
    assert "3.9.2 is too old" in line
    assert "PYTHON=python3.11" in line


def test_a_python_without_venv_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "ensurepip", None)
    assert "apt-get install python3-venv" in preflight.missing_python()


def test_a_missing_browser_is_named(monkeypatch):
    monkeypatch.delenv("MESHOT_BROWSER", raising=False)
    monkeypatch.setattr(preflight.shutil, "which", lambda name: None)
    assert "apt-get install chromium" in preflight.missing_browser()
    monkeypatch.setenv("MESHOT_BROWSER", "/a/browser")
    assert preflight.browser() == "/a/browser"


@pytest.mark.parametrize(("printed", "expected"), [(b"one sentence\n", "one sentence"), (b"", "libegl1")])
def test_a_missing_display_is_named(monkeypatch, printed, expected):
    asked = SimpleNamespace(returncode=1, stdout=printed)
    monkeypatch.setattr(preflight.subprocess, "run", lambda *a, **k: asked)
    assert expected in preflight.missing_display()


def test_make_alone_prints_the_commands(root):
    printed = subprocess.run(["make"], cwd=root, capture_output=True, text=True, check=True).stdout
    commands = ("book", "test", "html", "notebooks", "lab", "lint", "clean")
    assert all(f"make {command} " in printed for command in commands)


def test_make_stops_at_an_old_python(root, tmp_path):
    """The rule that makes the environment asks first."""
    old = tmp_path / "python"
    old.write_text('#!/bin/sh\necho "too old" && exit 1\n')
    old.chmod(0o755)
    command = ["make", "html", f"PYTHON={old}", f"VENV={tmp_path}/venv"]
    result = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False)
    assert result.returncode != 0
    assert "too old" in result.stdout
    assert not (tmp_path / "venv").exists()
