"""Run every stored notebook again and compare its outputs, strictly; some a second time as an older CPU would.

Part of ``make test``. ``python tests/check_notebooks.py [NAME ...]`` checks the named chapters only.
"""

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path

from meshot_book.notebook.environment import KERNEL_ENVIRONMENT, stated_seconds

NOTEBOOKS = Path(__file__).resolve().parent.parent / "notebooks"
#: Run a second time with torch's plain code path instead of the vectorised one: points, meshes, a real image.
OLDER_CPU = {"ATEN_CPU_CAPABILITY": "default"}
ON_AN_OLDER_CPU = ("01_circle_to_polygon", "10_mesh_as_measure", "36_a_real_scan")


def run_nbval(path: Path, **extra: str) -> subprocess.CompletedProcess:
    """Run nbval on a notebook, with additions to the environment, each kernel on sockets of its own."""
    # Without --capture=sys, pytest would keep what a dying kernel says.
    command = [sys.executable, "-m", "pytest", "-q", "--capture=sys", "-p", "kernels", "-p", "no:cacheprovider"]
    command += ["-c", os.devnull, "--rootdir", str(path.parent)]
    command += ["--nbval", "--nbval-current-env", "--nbval-cell-timeout=600", str(path)]
    paths = [str(NOTEBOOKS.parent / "book"), os.environ.get("PYTHONPATH", "")]
    environment = os.environ | KERNEL_ENVIRONMENT | {"PYTHONPATH": os.pathsep.join(paths)} | extra
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "encoding": "utf-8"}
    return subprocess.run(command, env=environment, cwd=path.parent, check=False, **pipes)


def seconds_of(name: str) -> int:
    """How long a chapter took when its outputs were stored, as it says at its foot."""
    return stated_seconds((NOTEBOOKS / f"{name}.ipynb").read_text(encoding="utf-8"))


def main(names: list[str]) -> int:
    """Compare on this CPU and as on an older one, a chapter on every core, the longest first; the exit status."""
    every = names or sorted(path.stem for path in NOTEBOOKS.glob("[0-9]*.ipynb"))
    runs = [(name, {}) for name in every] + [(name, OLDER_CPU) for name in every if name in ON_AN_OLDER_CPU]
    runs.sort(key=lambda run: -seconds_of(run[0]))
    print(f"comparing {len(every)} notebooks with their stored outputs, {len(runs) - len(every)} of them twice")
    failed = []
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        waiting = {pool.submit(run_nbval, NOTEBOOKS / f"{name}.ipynb", **extra): (name, extra) for name, extra in runs}
        for done in as_completed(waiting):
            name, extra = waiting[done]
            ended = done.result()
            print(f"\n{name}{', as on an older CPU' if extra else ''}\n{ended.stdout}", flush=True)
            failed += [name] if ended.returncode else []
    print(f"{len(runs) - len(failed)} passed, {len(failed)} failed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
