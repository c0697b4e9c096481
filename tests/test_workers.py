"""Worker processes end with the process that started them, even if that is killed."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

CODE = """
import concurrent.futures, multiprocessing, os, time
from meshot.workers import begin_worker

if __name__ == "__main__":
    context = multiprocessing.get_context("spawn")
    with concurrent.futures.ProcessPoolExecutor(1, context, initializer=begin_worker) as pool:
        print(pool.submit(os.getpid).result(), flush=True)
        pool.submit(time.sleep, 600).result()
"""


def runs(pid: int) -> bool:
    """Whether a process is there, and more than an entry that nobody has asked for yet."""
    try:
        return Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="processes are looked up in /proc")
def test_a_worker_does_not_outlive_a_killed_parent(tmp_path):
    (tmp_path / "pool.py").write_text(CODE)
    with subprocess.Popen(
        [sys.executable, str(tmp_path / "pool.py")], stdout=subprocess.PIPE, encoding="utf-8"
    ) as parent:
        worker = int(parent.stdout.readline())
        assert runs(worker)
        os.kill(parent.pid, signal.SIGKILL)
    end = time.monotonic() + 60
    while runs(worker) and time.monotonic() < end:
        time.sleep(0.05)
    assert not runs(worker)
