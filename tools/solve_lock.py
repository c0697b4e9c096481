"""Solve ``requirements.lock`` again: exact versions for all platforms, without hosts and torch's CUDA packages.

pip takes the CUDA packages from torch's metadata if the CUDA build is installed, so that one lock serves both builds.
"""

import re
import subprocess
import sys
from pathlib import Path

from meshot.files import whole_file

ROOT = Path(__file__).resolve().parent.parent
LEFT_OUT = re.compile(r"^(nvidia-|cuda-|triton)")
TORCH = "torch==2.13.0"


def main() -> None:
    """Solve with uv and write the lock file."""
    command = [sys.executable, "-m", "uv", "pip", "compile", "--universal", "--fork-strategy", "fewest", "--quiet"]
    command += ["--python-version", "3.11", "--extra", "book", "--extra", "test", "--extra", "workflow"]
    command += ["--no-header", "--no-annotate"]
    solved = subprocess.run(
        [*command, "--constraint", "-", "pyproject.toml"],
        cwd=ROOT,
        input=TORCH,
        capture_output=True,
        text=True,
        check=True,
    )
    lines = [line for line in solved.stdout.splitlines() if not LEFT_OUT.match(line)]
    with whole_file(ROOT / "requirements.lock") as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
