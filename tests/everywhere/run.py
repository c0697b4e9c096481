"""Run the numerical tests as on other processors and in another place: tests/everywhere/run.py [FILE ...].

Files and folders are named from ``tests/``. The exit status is 1 if a test fails on any of the machines.
"""

import argparse
import os
import subprocess
import sys
from pathlib import Path

from numpy._core import _multiarray_umath

ROOT = Path(__file__).resolve().parents[2]
NUMERICAL = ["loss", "measure", "metrics", "mesh", "flow", "volume", "model"]
#: Drawn problems a loss: processors differ in rounding, which few problems show; ``make test`` draws more.
N_DRAWN = "100"
IN_PARALLEL = ("-n", "logical", "--dist", "loadfile")

#: NumPy's optional instruction sets that this processor has.
OPTIONAL = [name for name in _multiarray_umath.__cpu_dispatch__ if _multiarray_umath.__cpu_features__[name]]
#: An old processor, as far as each library lets itself be told, west of Greenwich by an odd offset, with text in ASCII
#: unless a file is opened as UTF-8, and with sets in another order.
OLD = {
    "ATEN_CPU_CAPABILITY": "default",
    "MKL_ENABLE_INSTRUCTIONS": "SSE4_2",
    "NPY_DISABLE_CPU_FEATURES": " ".join(OPTIONAL),
    "OPENBLAS_CORETYPE": "Nehalem",
    "TZ": "AAA+09:45",
    "LC_ALL": "C",
    "PYTHONUTF8": "0",
    "PYTHONCOERCECLOCALE": "0",
    "PYTHONHASHSEED": "4242",
}
#: Machine -> the variables that emulate it, and the instruction set, as /proc/cpuinfo names it, that it needs.
MACHINES = {
    "as it is": ({}, ""),
    "torch with AVX2": ({"ATEN_CPU_CAPABILITY": "avx2"}, "avx2"),
    "MKL with AVX2": ({"MKL_ENABLE_INSTRUCTIONS": "AVX2"}, "avx2"),
    "MKL in compatible mode": ({"MKL_CBWR": "COMPATIBLE"}, ""),
    "OpenBLAS for Haswell": ({"OPENBLAS_CORETYPE": "Haswell"}, "avx2"),
    "OpenBLAS for Zen": ({"OPENBLAS_CORETYPE": "Zen"}, "avx2"),
    "OpenBLAS for Skylake-X": ({"OPENBLAS_CORETYPE": "SkylakeX"}, "avx512f"),
    "numba for any x86-64": ({"NUMBA_CPU_NAME": "generic"}, ""),
    "numba without AVX-512": ({"NUMBA_CPU_NAME": "haswell", "NUMBA_CPU_FEATURES": ""}, "avx2"),
    "two threads": ({f"{name}_NUM_THREADS": "2" for name in ("OMP", "MKL", "OPENBLAS", "NUMBA")}, ""),
    "old, and elsewhere": (OLD, ""),
}


def run_on(variables: dict[str, str], *words: str) -> subprocess.CompletedProcess:
    """Run Python with these words on an emulated machine, in the checkout."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    environment |= {"PYTHONPATH": str(ROOT / "src")} | variables
    return subprocess.run(
        [sys.executable, *words], cwd=ROOT, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        encoding="utf-8", errors="replace", check=False,
    )  # fmt: skip


def main() -> int:
    """Run the tests on each machine, and say what failed; the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="*", default=NUMERICAL)
    parser.add_argument("--machine", default="", help="only those whose name contains this")
    chosen = parser.parse_args()
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    os.environ.setdefault("MESHOT_DRAWN", N_DRAWN)
    flags = Path("/proc/cpuinfo").read_text(encoding="utf-8") if Path("/proc/cpuinfo").exists() else ""
    failed = False
    for name, (variables, needed) in MACHINES.items():
        if chosen.machine not in name:
            continue
        if needed not in flags:
            print(f"{name}: this processor has no {needed}", flush=True)
            continue
        done = run_on(
            variables, "-m", "pytest", "-p", "no:cacheprovider", *IN_PARALLEL, *(f"tests/{f}" for f in chosen.files)
        )
        last = next(reversed(done.stdout.strip().splitlines()), "")
        print(f"{name}: {last if done.returncode == 0 else 'FAILED'}", flush=True)
        if done.returncode:
            failed = True
            print(f"{variables}\n{done.stdout}", flush=True)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
