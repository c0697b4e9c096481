"""Run every stored notebook again and compare its outputs, strictly; some a second time as an older CPU would.

Part of ``make test``. ``python tests/check_notebooks.py [NAME ...]`` checks the named chapters only.
"""

import os
import subprocess
import sys
from pathlib import Path

from meshot_book.notebook.environment import KERNEL_ENVIRONMENT

NOTEBOOKS = Path(__file__).resolve().parent.parent / "notebooks"
#: Run a second time with torch's plain code path instead of the vectorised one: points, meshes, a real image.
ON_AN_OLDER_CPU = ("01_circle_to_polygon", "10_mesh_as_measure", "36_a_real_scan")


def compare(names: list[str], extra: dict[str, str]) -> int:
    """Run nbval on the named chapters; the exit status."""
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-p",
        "no:cacheprovider",
        "-c",
        os.devnull,
        "--rootdir",
        str(NOTEBOOKS),
    ]
    command += ["--nbval", "--nbval-current-env", "--nbval-cell-timeout=300"]
    files = [str(NOTEBOOKS / f"{name}.ipynb") for name in names]
    return subprocess.run([*command, *files], env=os.environ | KERNEL_ENVIRONMENT | extra, check=False).returncode


def main(names: list[str]) -> int:
    """Compare on this CPU, then on an older one; the exit status."""
    every = names or sorted(path.stem for path in NOTEBOOKS.glob("[0-9]*.ipynb"))
    older = [name for name in every if name in ON_AN_OLDER_CPU]
    print(
        f"comparing {len(every)} notebooks with their stored outputs, then {len(older)} as on an older CPU", flush=True
    )
    return compare(every, {}) or (compare(older, {"ATEN_CPU_CAPABILITY": "default"}) if older else 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
