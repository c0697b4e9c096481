"""Without OpenGL there is a sentence, not a crash."""

import os
import subprocess
import sys

import pytest

from meshot.view import display

# The loader of EGL drivers is told of a list without drivers.
HIDDEN = {"__EGL_VENDOR_LIBRARY_FILENAMES": os.devnull}


@pytest.fixture
def fresh_probe():
    """The probe forgets its verdict before and after."""
    display.usable_window.cache_clear()
    yield
    display.usable_window.cache_clear()


def _run(*arguments: str, **environment: str) -> subprocess.CompletedProcess:
    return subprocess.run(
        [sys.executable, *arguments], env=os.environ | environment, capture_output=True, encoding="utf-8", check=False
    )


def test_the_verdict_is_printed_and_the_window_class_named():
    done = _run("-m", "meshot.view.display")
    assert done.returncode == 0, done.stderr
    assert "vtk" in done.stdout
    assert done.stdout.count("\n") == 1


def test_vtk_fails_in_its_own_process_where_no_driver_is():
    """The reason for the probe (here it ends by SIGSEGV); without the disguise the same trial passes."""
    window = display.usable_window()
    asked = {display.VARIABLE: window}
    assert _run("-c", display._TRIAL, window, **asked).returncode == 0
    assert _run("-c", display._TRIAL, "another window", **asked).returncode == 1
    assert _run("-c", display._TRIAL, window, **asked, **HIDDEN).returncode != 0


def test_a_machine_without_opengl_gets_one_sentence_with_the_packages():
    code = (
        "from meshot.view import display; display.WINDOWS['linux'] = ('vtkEGLRenderWindow',); "
        "raise SystemExit(display.main())"
    )
    done = _run("-c", code, VTK_DEFAULT_OPENGL_WINDOW="", **HIDDEN)
    assert done.returncode == 1
    assert done.stdout == ""
    assert done.stderr.strip() == display.REMEDY
    assert "libegl1 libgl1-mesa-dri" in done.stderr
    assert "libosmesa6" in done.stderr


def test_a_picture_is_refused_before_vtk_is_touched(monkeypatch, fresh_probe):
    monkeypatch.setattr(display, "_draws", lambda window: False)
    with pytest.raises(RuntimeError, match="apt-get install"):
        display.require_display()


def test_the_first_window_that_draws_is_used_and_the_users_choice_comes_first(monkeypatch, fresh_probe):
    tried = []
    monkeypatch.setenv(display.VARIABLE, "vtkMyWindow")
    monkeypatch.setattr(display, "_draws", lambda window: tried.append(window) or window == "vtkOSOpenGLRenderWindow")
    monkeypatch.setattr(display.sys, "platform", "linux")
    display.require_display()
    assert tried == ["vtkMyWindow", "vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow"]
    assert os.environ[display.VARIABLE] == "vtkOSOpenGLRenderWindow"


def test_a_window_that_hangs_counts_as_none(monkeypatch):
    def hang(*arguments, timeout, **options):
        raise subprocess.TimeoutExpired(arguments, timeout)

    monkeypatch.setattr(display.subprocess, "run", hang)
    assert not display._draws("vtkEGLRenderWindow")


def test_an_llvm_of_another_module_is_loaded_before_that_of_opengl(tmp_path):
    """With a PyTorch build with CUDA, ``torch.optim`` imports Triton, which crashes if Mesa has drawn before."""
    (tmp_path / "pyvista.py").touch()  # the real one takes seconds
    (tmp_path / "triton.py").write_text("import sys\nprint('pyvista' in sys.modules)\n")
    code = "from meshot.view.surface import _drawing_library; print(_drawing_library().__name__)"
    done = _run("-c", code, PYTHONPATH=os.pathsep.join((str(tmp_path), os.environ.get("PYTHONPATH", ""))))
    assert done.stdout.split() == ["False", "pyvista"], done.stderr
    # A module that is there and cannot be loaded is not needed for drawing.
    (tmp_path / "triton.py").write_text("raise ImportError\n")
    done = _run("-c", code, PYTHONPATH=os.pathsep.join((str(tmp_path), os.environ.get("PYTHONPATH", ""))))
    assert done.stdout.split() == ["pyvista"], done.stderr
