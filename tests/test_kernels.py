"""Kernels are compiled once, say so, and do without a cache where there is no place for one."""

import os
import subprocess
import sys

import pytest

from meshot import _kernels

CODE = """
import sys; sys.path.insert(0, sys.argv[1])
from meshot._kernels import kernel
from _kernel_of_a_test import one, two
one(1.0), one(2.0), two(3)
"""
KERNELS = """
from meshot._kernels import kernel

@kernel("a test", 7)
def one(x):
    return x + 1

@kernel("a test", 7)
def two(x):
    return x + 2
"""


def run(tmp_path, **environment):
    source = tmp_path / "_kernel_of_a_test.py"
    if not source.exists():  # numba before 0.68 compiles a file anew that is younger than the cache
        source.write_text(KERNELS)
    return subprocess.run(
        [sys.executable, "-c", CODE, str(tmp_path)],
        env=os.environ | environment, capture_output=True, encoding="utf-8", check=True,
    ).stderr  # fmt: skip


def test_the_first_process_says_that_it_compiles_and_the_second_need_not(tmp_path):
    cache = str(tmp_path / "cache")
    assert run(tmp_path, NUMBA_CACHE_DIR=cache) == "meshot: compiling the kernels of a test, once; about 7 s\n"
    assert run(tmp_path, NUMBA_CACHE_DIR=cache) == ""


def test_without_a_folder_for_the_cache_every_process_compiles(monkeypatch, capsys):
    """A function without a file has no cache, as one in a folder that cannot be written to."""
    monkeypatch.setattr(_kernels, "_lost", [])
    names = {"kernel": _kernels.kernel}
    exec('@kernel("what cannot be kept", 3)\ndef add(x):\n    return x + 1', names)
    assert names["add"](1.0) == 2.0
    said = capsys.readouterr().err
    assert said.startswith(
        "meshot: compiling the kernels of what cannot be kept, about 3 s in every process; no folder"
    )
    with pytest.raises(ValueError, match="set NUMBA_CACHE_DIR"):
        _kernels.require_kept()
