"""Other machines, emulated on this one: processors by switches of the libraries, places by the environment."""

import ctypes
import dataclasses
import functools
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from numpy._core import _multiarray_umath

ROOT = Path(__file__).resolve().parents[2]
#: What tests need of a checkout.
PARTS = ("src", "tests", "tools", "book")
PR_CAPBSET_DROP, CAP_DAC_OVERRIDE = 24, 1

#: Older processors, as far as each library lets itself be told.
NO_VECTORS = {"ATEN_CPU_CAPABILITY": "default"}
OLD_MKL = {"MKL_ENABLE_INSTRUCTIONS": "SSE4_2"}
#: NumPy's optional instruction sets that this processor has.
OPTIONAL = [name for name in _multiarray_umath.__cpu_dispatch__ if _multiarray_umath.__cpu_features__[name]]
OLD_NUMPY = {"NPY_DISABLE_CPU_FEATURES": " ".join(OPTIONAL)}
#: West of Greenwich by an odd offset, text in ASCII unless a file is opened as UTF-8, sets in another order.
ELSEWHERE = {
    "TZ": "AAA+09:45",
    "LC_ALL": "C",
    "PYTHONUTF8": "0",
    "PYTHONCOERCECLOCALE": "0",
    "PYTHONHASHSEED": "4242",
}


@dataclasses.dataclass(frozen=True)
class Machine:
    """A machine to be emulated.

    Parameters
    ----------
    name : str
    environment : dict
        Variables that are set.
    place : str
        "here", or a copy of the checkout: "spaced" in a folder with a space in its name, "read-only" without the right
        to write.
    needs : str
        An instruction set of the processor, as /proc/cpuinfo names it, without which the machine cannot be emulated.
    """

    name: str
    environment: dict[str, str] = dataclasses.field(default_factory=dict)
    place: str = "here"
    needs: str = ""


MACHINES = [
    Machine("as it is"),
    Machine("torch with AVX2", {"ATEN_CPU_CAPABILITY": "avx2"}, needs="avx2"),
    Machine("torch without vectors", NO_VECTORS),
    Machine("MKL with SSE4.2", OLD_MKL),
    Machine("MKL with AVX2", {"MKL_ENABLE_INSTRUCTIONS": "AVX2"}, needs="avx2"),
    Machine("MKL in compatible mode", {"MKL_CBWR": "COMPATIBLE"}),
    Machine("OpenBLAS for Nehalem", {"OPENBLAS_CORETYPE": "Nehalem"}),
    Machine("OpenBLAS for Haswell", {"OPENBLAS_CORETYPE": "Haswell"}, needs="avx2"),
    Machine("OpenBLAS for Zen", {"OPENBLAS_CORETYPE": "Zen"}, needs="avx2"),
    Machine("OpenBLAS for Skylake-X", {"OPENBLAS_CORETYPE": "SkylakeX"}, needs="avx512f"),
    Machine("NumPy at its baseline", OLD_NUMPY),
    Machine("numba for any x86-64", {"NUMBA_CPU_NAME": "generic"}),
    Machine("numba without AVX-512", {"NUMBA_CPU_NAME": "haswell", "NUMBA_CPU_FEATURES": ""}, needs="avx2"),
    Machine("one thread", {f"{name}_NUM_THREADS": "1" for name in ("OMP", "MKL", "OPENBLAS", "NUMBA")}),
    Machine("two threads", {f"{name}_NUM_THREADS": "2" for name in ("OMP", "MKL", "OPENBLAS", "NUMBA")}),
    Machine("another place", ELSEWHERE),
    Machine("a path with a space", place="spaced"),
    Machine("a read-only checkout", place="read-only"),
    Machine("all of it that is old", NO_VECTORS | OLD_MKL | OLD_NUMPY | {"OPENBLAS_CORETYPE": "Nehalem"} | ELSEWHERE),
]


@functools.cache
def processor_has() -> set[str]:
    """The instruction sets of this processor."""
    text = Path("/proc/cpuinfo").read_text(encoding="utf-8") if Path("/proc/cpuinfo").exists() else ""
    return set(next((line for line in text.splitlines() if line.startswith("flags")), "").split())


def bound_by_permissions() -> None:
    """Let root respect the rights of files: in a process that is about to start another program."""
    ctypes.CDLL(None).prctl(PR_CAPBSET_DROP, CAP_DAC_OVERRIDE, 0, 0, 0)


@contextmanager
def checkout(place: str) -> Iterator[Path]:
    """The checkout of a machine; a copy is removed at the end."""
    if place == "here":
        yield ROOT
        return
    with tempfile.TemporaryDirectory(prefix="a path with spaces ") as folder:
        copy = Path(folder) / "meshes as measures"
        for part in PARTS:
            shutil.copytree(ROOT / part, copy / part, ignore=shutil.ignore_patterns("__pycache__", ".*"))
        shutil.copy(ROOT / "pyproject.toml", copy)
        try:
            _set_writable(copy, place != "read-only")
            yield copy
        finally:
            _set_writable(copy, True)


def _set_writable(folder: Path, writable: bool) -> None:
    for path in [folder, *folder.rglob("*")]:
        mode = path.stat().st_mode
        path.chmod(mode | 0o200 if writable else mode & ~0o222)


def run_on(machine: Machine, command: Callable[[Path], list[str]]) -> subprocess.CompletedProcess | None:
    """Run a command on an emulated machine; None if this processor cannot be that machine.

    Parameters
    ----------
    machine : Machine
    command : callable
        From the checkout to the words of the command, which runs in it.
    """
    if machine.needs and machine.needs not in processor_has():
        return None
    with checkout(machine.place) as folder:
        environment = os.environ | {"PYTHONPATH": str(folder / "src")} | machine.environment
        for name in [n for n in environment if n.startswith("PYTEST_")]:
            del environment[name]
        return subprocess.run(
            command(folder), cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            encoding="utf-8", errors="replace", check=False,
            preexec_fn=bound_by_permissions if machine.place == "read-only" and os.geteuid() == 0 else None,
        )  # fmt: skip


def run_tests(machine: Machine, files: list[str], more: tuple[str, ...] = ()) -> subprocess.CompletedProcess | None:
    """Run test files, named from ``tests/``, on an emulated machine."""

    def command(folder: Path) -> list[str]:
        words = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", *more]  # a second -q would hide the counts
        return [*words, *(str(folder / "tests" / name) for name in files)]

    return run_on(machine, command)


def counts_of(printed: str) -> dict[str, int]:
    """How many tests passed, failed, and so on, from pytest's last line."""
    last = next((line for line in reversed(printed.splitlines()) if re.search(r"\d+ (passed|failed|error)", line)), "")
    return {word: int(number) for number, word in re.findall(r"(\d+) (passed|failed|errors?|skipped)", last)}
