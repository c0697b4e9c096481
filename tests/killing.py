"""A training process that is killed by the system, and what is compared of trainings."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import torch

START = "import sys, torch\ntorch.set_num_threads(1)\nsys.path[:0] = [{tests!r}]\n"


def killed_after_its_first_state(code: str, tests: Path, folder: Path) -> None:
    """Run ``code`` in a process of its own and kill it as soon as ``folder`` holds the state of a training."""
    victim = subprocess.Popen(
        [sys.executable, "-c", START.format(tests=str(tests)) + code], env=os.environ | {"MESHOT_UNCHECKED": "1"}
    )
    state, patience = folder / "training.safetensors", time.monotonic() + 120
    while not state.exists() and victim.poll() is None and time.monotonic() < patience:
        time.sleep(0.01)
    victim.send_signal(signal.SIGKILL)
    victim.wait()
    assert state.exists()


def same(first: torch.nn.Module, second: torch.nn.Module) -> bool:
    """Whether every weight is the same, to the bit."""
    return all(torch.equal(a, b) for a, b in zip(first.state_dict().values(), second.state_dict().values()))


def without_seconds(log: list[dict]) -> list[dict]:
    """A log without what differs between runs."""
    return [{k: v for k, v in line.items() if k != "cpu_seconds"} for line in log]
