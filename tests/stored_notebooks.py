"""Run a stored notebook again and compare its outputs, strictly."""

import os
import subprocess
import sys
from pathlib import Path

from meshot_book.notebook.environment import KERNEL_ENVIRONMENT

NOTEBOOKS = Path(__file__).resolve().parent.parent / "notebooks"


def run_nbval(path: Path, **extra: str) -> subprocess.CompletedProcess:
    """Run nbval on a notebook, with additions to the environment, each kernel on sockets of its own."""
    # Without --capture=sys, pytest would keep what a dying kernel says.
    command = [sys.executable, "-m", "pytest", "-q", "--capture=sys", "-p", "kernels", "-p", "no:cacheprovider"]
    command += ["-p", "no:anyio", "-c", os.devnull, "--rootdir", str(path.parent)]
    command += ["--nbval", "--nbval-current-env", "--nbval-cell-timeout=600", str(path)]
    paths = [str(NOTEBOOKS.parent / "book"), os.environ.get("PYTHONPATH", "")]
    environment = os.environ | KERNEL_ENVIRONMENT | {"PYTHONPATH": os.pathsep.join(paths)} | extra
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "encoding": "utf-8"}
    return subprocess.run(command, env=environment, cwd=path.parent, check=False, **pipes)
