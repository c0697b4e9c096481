"""The card at the end of a chapter: the environment in which it was run."""

import platform
import re
import time

import torch

from meshot.provenance import package_version

SHOWN = ("meshot", "torch", "numpy", "scipy", "POT", "pyvista")

#: Environment of every notebook kernel: two threads for each library, so that stored outputs can be compared.
KERNEL_ENVIRONMENT = {
    "OMP_NUM_THREADS": "2",
    "MKL_NUM_THREADS": "2",
    "NUMBA_NUM_THREADS": "2",
    "OPENBLAS_NUM_THREADS": "2",
    "PYDEVD_DISABLE_FILE_VALIDATION": "1",
    "PYTHONHASHSEED": "0",
}


def environment_card(started: float, seed: int) -> str:
    """Versions, CPU capability, threads, seed and seconds since ``started`` (a ``time.perf_counter()`` value)."""
    versions = ", ".join(f"{name} {package_version(name)}" for name in SHOWN)
    cpu = f"{platform.machine()}, {torch.backends.cpu.get_cpu_capability()}, {torch.get_num_threads()} threads"
    return (
        f"python {platform.python_version()}, {versions}\n"
        f"CPU {cpu}; seed {seed}; ran in {time.perf_counter() - started:.0f} s"
    )


def stated_seconds(text: str) -> int:
    """The sum of the seconds that environment cards in a text state; 0 if there is none."""
    return sum(int(found) for found in re.findall(r"ran in (\d+) s", text))
