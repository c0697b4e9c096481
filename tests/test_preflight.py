"""What is missing is said in one line with its remedy, and stops make before anything crashes."""

import re
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
    assert preflight.missing_python().packages == ("python3-venv",)


@pytest.fixture
def no_browser(monkeypatch, tmp_path):
    monkeypatch.delenv("MESHOT_BROWSER", raising=False)
    monkeypatch.setattr(preflight.shutil, "which", lambda name: "/usr/bin/apt-get" if name == "apt-get" else None)
    monkeypatch.setattr(preflight, "DOWNLOADED", str(tmp_path / "chromium-*" / "chrome"))
    return tmp_path


def test_a_missing_browser_is_named(no_browser, monkeypatch):
    monkeypatch.setattr(preflight, "system_name", lambda: "debian")
    assert preflight.missing_browser().packages == ("chromium",)
    monkeypatch.setattr(preflight, "system_name", lambda: "ubuntu")
    assert preflight.missing_browser().packages == ()  # a snap, which could not read what the tests write
    ((python, *words),) = preflight.missing_browser().commands
    assert (python, " ".join(words)) == (sys.executable, "-m playwright install --with-deps chromium")


def test_a_browser_is_found_by_name_or_where_playwright_put_it(no_browser, monkeypatch):
    assert preflight.browser() is None
    (no_browser / "chromium-1200").mkdir()
    (no_browser / "chromium-1200" / "chrome").touch()
    assert preflight.browser() == str(no_browser / "chromium-1200" / "chrome")
    monkeypatch.setenv("MESHOT_BROWSER", "/a/browser")
    assert preflight.browser() == "/a/browser"
    assert preflight.missing_browser() is None


def test_a_vtk_that_cannot_draw_is_named(monkeypatch):
    asked = SimpleNamespace(returncode=1, stdout=b"")
    monkeypatch.setattr(preflight.subprocess, "run", lambda *a, **k: asked)
    assert "libegl1" in preflight.missing_display().packages


def test_a_browser_that_cannot_be_steered_is_named(monkeypatch):
    monkeypatch.setattr(preflight, "loads", lambda name: name != "libatomic.so.1")
    assert preflight.missing_driver().packages == ("libatomic1",)
    monkeypatch.setattr(preflight.sys, "platform", "darwin")
    assert preflight.missing_driver() is None


#: The libraries that are there, whether Mesa has a driver, and whether surfaces can be drawn before VTK is installed.
LIBRARIES = [
    ([], True, False),
    (["libEGL.so.1"], True, False),
    (["libEGL.so.1", "libEGL_mesa.so.0"], False, False),
    (["libEGL.so.1", "libEGL_mesa.so.0"], True, True),
    (["libEGL.so.1", "libEGL_nvidia.so.0"], False, True),
    (["libOSMesa.so.8"], False, True),
]


@pytest.mark.parametrize(("there", "driver", "enough"), LIBRARIES)
def test_opengl_is_looked_for_before_vtk_is_there(no_browser, monkeypatch, there, driver, enough):
    monkeypatch.setattr(preflight.importlib.util, "find_spec", lambda name: None)
    monkeypatch.setattr(preflight, "loads", lambda name: name in there)
    monkeypatch.setattr(preflight, "MESA_DRIVERS", (str(no_browser) if driver else "/none",))
    assert (preflight.missing_display() is None) == enough


#: Everything that the two commands ask of the system.
ALL = ("python3-venv", "libegl1 libegl-mesa0 libgl1-mesa-dri", "chromium", "libatomic1")


@pytest.fixture
def bare(no_browser, monkeypatch):
    """A system without anything, on which installing works; the commands that were run."""
    ran = []
    monkeypatch.setitem(sys.modules, "ensurepip", None)
    monkeypatch.setattr(preflight, "system_name", lambda: "debian")
    monkeypatch.setattr(preflight, "has_opengl", lambda: bool(ran))
    monkeypatch.setattr(preflight, "loads", lambda name: bool(ran))
    monkeypatch.setattr(preflight.importlib.util, "find_spec", lambda name: None)
    monkeypatch.setattr(preflight.os, "geteuid", lambda: 1000)
    monkeypatch.delenv("YES", raising=False)

    def run(command, check):
        ran.append(" ".join(command))
        monkeypatch.delitem(sys.modules, "ensurepip", raising=False)
        monkeypatch.setenv("MESHOT_BROWSER", "/usr/bin/chromium")
        return SimpleNamespace(returncode=0)

    monkeypatch.setattr(preflight.subprocess, "run", run)
    return ran


def test_everything_is_listed_at_once_and_nothing_is_done_without_an_answer(bare, capsys, monkeypatch):
    monkeypatch.setattr(preflight.sys, "stdin", SimpleNamespace(isatty=lambda: False))
    assert preflight.main(["python", "display", "browser"]) == 1
    *reasons, said, command = capsys.readouterr().out.splitlines()
    assert [line.split(":")[1].strip() for line in reasons] == list(ALL)
    assert "nothing was changed" in said
    assert "YES=1" in said
    install = "sudo apt-get install -y --no-install-recommends " + " ".join(ALL)
    assert command.strip() == "sudo apt-get update -qq && " + install
    assert bare == []


@pytest.mark.parametrize(("answer", "status"), [("y", 0), ("Yes ", 0), ("", 1), ("n", 1)])
def test_a_terminal_is_asked(bare, monkeypatch, answer, status):
    monkeypatch.setattr(preflight.sys, "stdin", SimpleNamespace(isatty=lambda: True))
    monkeypatch.setattr(preflight.sys, "stdout", SimpleNamespace(isatty=lambda: True, write=len, flush=lambda: None))
    monkeypatch.setattr("builtins.input", lambda question: answer)
    assert preflight.main(["python", "display", "browser"]) == status
    assert len(bare) == (2 if status == 0 else 0)


def test_a_script_says_yes_beforehand(bare, monkeypatch):
    monkeypatch.setenv("YES", "1")
    assert preflight.main(["python", "display", "browser"]) == 0
    assert bare[1].endswith(" ".join(ALL))


def test_ubuntu_gets_a_browser_before_there_is_an_environment(bare, monkeypatch, root):
    monkeypatch.setattr(preflight, "system_name", lambda: "ubuntu")
    monkeypatch.setenv("YES", "1")
    assert preflight.main(["python", "display", "browser"]) == 0
    _, packages, environment, playwright, download = bare
    assert packages.endswith("libatomic1")
    assert "chromium" not in packages
    place = root / "build" / "playwright"
    assert environment == f"{sys.executable} -m venv {place}"
    (version,) = re.findall("^playwright==.*", (root / "requirements.lock").read_text(encoding="utf-8"), re.M)
    assert playwright == f"{place}/bin/python -m pip install -q {version}"
    assert download == f"{place}/bin/python -m playwright install --with-deps chromium"


def test_what_is_still_missing_after_it_was_installed_is_said(bare, monkeypatch, capsys):
    monkeypatch.setenv("YES", "1")
    monkeypatch.setattr(preflight, "has_opengl", lambda: False)
    assert preflight.main(["python", "display", "browser"]) == 1
    assert capsys.readouterr().out.splitlines()[-1].startswith("still missing: the chapters draw")


def test_a_command_that_fails_stops_it(bare, monkeypatch, capsys):
    monkeypatch.setenv("YES", "1")
    monkeypatch.setattr(preflight.subprocess, "run", lambda *a, **k: SimpleNamespace(returncode=100))
    assert preflight.main(["python"]) == 1
    assert "this command failed" in capsys.readouterr().out


def test_a_system_without_apt_is_told_the_names(bare, monkeypatch, capsys):
    monkeypatch.setenv("YES", "1")
    monkeypatch.setattr(preflight.shutil, "which", lambda name: None)
    assert preflight.main(["python", "browser"]) == 1
    assert "there is no apt-get here" in capsys.readouterr().out
    assert bare == []


@pytest.fixture
def run_make(root, monkeypatch):
    """Run make as from a shell, also where an outer make runs these tests: its flags are not passed on."""
    for name in ("MAKEFLAGS", "MFLAGS", "MAKELEVEL", "MAKEOVERRIDES"):
        monkeypatch.delenv(name, raising=False)

    def run(*words: str) -> subprocess.CompletedProcess:
        return subprocess.run(["make", *words], cwd=root, capture_output=True, encoding="utf-8", check=False)

    return run


def test_make_stops_at_an_old_python(run_make, tmp_path):
    """The rule that makes the environment asks first."""
    old = tmp_path / "python"
    old.write_text('#!/bin/sh\necho "too old" && exit 1\n')
    old.chmod(0o755)
    result = run_make("html", f"PYTHON={old}", f"VENV={tmp_path}/venv")
    assert result.returncode != 0
    assert "too old" in result.stdout
    assert not (tmp_path / "venv").exists()


@pytest.mark.parametrize(
    ("target", "expected"), [("html", "python"), ("book", "python display"), ("test", "python display browser")]
)
def test_make_looks_for_everything_before_it_makes_the_environment(run_make, tmp_path, target, expected):
    lines = run_make("-n", target, f"VENV={tmp_path}/venv", "PYTHON=py").stdout.splitlines()
    assert lines[0] == f"py tools/preflight.py {expected}"
    assert "py -m venv" in lines[2]
