"""Solve ``requirements.lock`` anew: exact versions for every platform, no host named, torch without its CUDA packages.

pip takes those from torch's own metadata where the CUDA build is installed, so that one lock serves both builds.
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
    """Solve with uv and write the lock."""
    command = [sys.executable, "-m", "uv", "pip", "compile", "--universal", "--fork-strategy", "fewest", "--quiet"]
    command += ["--python-version", "3.11", "--extra", "book", "--extra", "test", "--no-header", "--no-annotate"]
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
