"""The quick part of the emulated machines; ``make test-everywhere`` runs all numerical tests on each of them."""

import json
import os
import sys
from pathlib import Path

import machines
import pytest
from machines import ELSEWHERE, NO_VECTORS, OLD_MKL, OLD_NUMPY, Machine, run_on, run_tests

OLD = Machine("old", NO_VECTORS | OLD_MKL | OLD_NUMPY | {"OPENBLAS_CORETYPE": "Nehalem"} | ELSEWHERE)


def test_values_are_the_same_on_an_old_processor_elsewhere():
    """Sliced, windowed, Chamfer, exact and Sinkhorn losses against closed forms."""
    done = run_tests(OLD, ["loss/test_values.py"])
    assert done.returncode == 0, done.stdout
    assert machines.counts_of(done.stdout)["passed"] > 10


SEEN = """
import json, locale, os, time
import meshot, torch
from meshot.mesh.shapes import icosphere
from numpy._core import _multiarray_umath as numpy
vectors = [name for name in numpy.__cpu_dispatch__ if numpy.__cpu_features__[name]]
encoding = locale.getpreferredencoding(False)
writes = os.access("src", os.W_OK)
assert meshot.__file__.startswith(os.getcwd())
assert meshot.chamfer(icosphere(1), icosphere(1)) == 0
print(json.dumps([torch.backends.cpu.get_cpu_capability(), vectors, encoding, time.timezone, writes]))
"""


def seen_on(machine):
    done = run_on(machine, lambda folder: [sys.executable, "-c", SEEN])
    return json.loads(done.stdout.splitlines()[-1])


def test_the_switches_are_thrown_in_a_checkout_that_cannot_be_written_to():
    """In a folder with spaces in its name, by a process that has no right to write there."""
    old = seen_on(Machine("old", OLD.environment, place="read-only"))
    assert old[0] in ("DEFAULT", "NO AVX")  # as this and as earlier versions of torch call it
    assert old[1:] == [[], "ANSI_X3.4-1968", 35100, False]


def test_a_machine_that_this_processor_cannot_be_is_left_out(monkeypatch):
    monkeypatch.setattr(machines, "processor_has", lambda: {"avx"})
    assert run_on(Machine("newer", needs="avx512f"), pytest.fail) is None


def test_a_copy_is_removed_and_the_checkout_stays():
    with machines.checkout("read-only") as folder:
        assert " " in str(folder)
        assert (folder / "src" / "meshot" / "__init__.py").is_file()
        assert not os.stat(folder / "src").st_mode & 0o222
    assert not folder.exists()
    with machines.checkout("here") as folder:
        assert folder == Path(machines.ROOT)


@pytest.mark.parametrize(
    ("printed", "expected"),
    [
        ("..\n12 passed in 3.00s\n", {"passed": 12}),
        ("== 1 failed, 2 passed, 3 skipped, 1 error in 1s ==", {"failed": 1, "passed": 2, "skipped": 3, "error": 1}),
        ("Segmentation fault", {}),
    ],
)
def test_what_pytest_counts_is_read(printed, expected):
    assert machines.counts_of(printed) == expected
