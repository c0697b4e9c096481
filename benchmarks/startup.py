"""CPU seconds of start-up: import, help, and a first call with and without compiled kernels.

Run as ``python benchmarks/startup.py``, in two minutes. Every line is measured in a separate process.
"""

import os
import resource
import subprocess
import sys
import tempfile

SLICED = """
import torch, meshot
points = torch.rand(200, 3, dtype=torch.float64, requires_grad=True)
measure = meshot.DiscreteMeasure(points)
meshot.sliced_wasserstein(measure, measure, meshot.quasi_directions(8, 3)).backward()
"""
EXACT = """
import meshot
from meshot.mesh.shapes import icosphere
sphere = icosphere(1)
measure = meshot.surface(meshot.Mesh(sphere.vertices.requires_grad_(), sphere.faces))
meshot.sliced_wasserstein(measure, measure, meshot.quasi_directions(8, 3)).backward()
"""
HELP = "import sys; sys.argv = ['meshot', '--help']; from meshot.cli import main; main()"
RUNS = {
    "import meshot": "import meshot",
    "meshot --help": HELP,
    "import torch": "import torch",
    "sliced loss between points": SLICED,
    "exact loss between surfaces": EXACT,
}


def cpu_seconds(code: str, cache: str) -> float:
    """CPU seconds of a new process that runs some code."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    environment = os.environ | {"NUMBA_CACHE_DIR": cache}
    subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    """Print a line for each start: cold (nothing compiled) and warm."""
    with tempfile.TemporaryDirectory() as cache:
        print("CPU seconds                    cold    warm")
        for name, code in RUNS.items():
            cold, warm = cpu_seconds(code, cache), cpu_seconds(code, cache)
            print(f"{name:<28} {cold:6.2f}  {warm:6.2f}", flush=True)


if __name__ == "__main__":
    main()
