"""Cost of a scan in a study: ``python benchmarks/study_cost.py``.

Runs ``meshot reconstruct`` on the MNI152 average in a process of its own, one thread, as a job of a cluster does, and
asks the operating system for its processor seconds and its largest resident memory (what ``/usr/bin/time -v`` prints).
Medians, written to ``experiments/cost/study.json``. Processor seconds include the start of Python.
"""

import argparse
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from meshot.anatomy import mni152_t1
from meshot.provenance import write_results
from meshot.volume import write_volume

ROOT = Path(__file__).resolve().parent.parent
OUTPUT = ROOT / "experiments" / "cost" / "study.json"
#: Runs a command and prints its exit status, its processor seconds and its largest resident memory in kB.
LAUNCHER = """
import os, sys
child = os.posix_spawn(sys.argv[1], sys.argv[1:], os.environ, file_actions=[(os.POSIX_SPAWN_DUP2, 2, 1)])
_, status, used = os.wait4(child, 0)
print(os.waitstatus_to_exitcode(status), used.ru_utime + used.ru_stime, used.ru_maxrss)
"""


def measured(command: list[str]) -> dict[str, float]:
    """Processor seconds, wall-clock seconds and the largest resident memory of a command.

    The command is started by a small process: a child inherits the largest memory of the process that starts it.
    """
    started = time.perf_counter()
    done = subprocess.run([sys.executable, "-I", "-S", "-c", LAUNCHER, *command], stdout=subprocess.PIPE, check=True)
    wall = time.perf_counter() - started
    code, seconds, kilobytes = done.stdout.split()
    if int(code):
        raise RuntimeError(f"{' '.join(command)} ended with {int(code)}")
    return {"CPU s": float(seconds), "wall s": wall, "memory MB": float(kilobytes) / 1000}


def reconstruction(threads: int, initial_only: bool) -> dict[str, float]:
    """The cost of one scan, from the start of the command to its end, and the size of what it writes."""
    with tempfile.TemporaryDirectory() as place:
        scan, out = Path(place, "scan.nii.gz"), Path(place, "out")
        write_volume(scan, mni152_t1())
        words = ["reconstruct", str(scan), "-o", str(out), "--threads", str(threads)]
        words += ["--initial-only"] if initial_only else []
        found = measured([sys.executable, "-m", "meshot", *words])
        return found | {"files MB": sum(file.stat().st_size for file in out.rglob("*")) / 1e6}


def main(words: list[str] | None = None) -> int:
    """Measure, print and store the cost."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--initial-only", action="store_true", help="without the flow")
    parser.add_argument("-o", "--output", type=Path, default=OUTPUT)
    chosen = parser.parse_args(words)
    started = time.perf_counter()
    rows = [reconstruction(chosen.threads, chosen.initial_only) for _ in range(chosen.repeats)]
    scan = {name: statistics.median(row[name] for row in rows) for name in rows[0]}
    print(", ".join(f"{value:.0f} {name}" for name, value in scan.items()))
    config = {"threads": chosen.threads, "repeats": chosen.repeats, "initial_only": chosen.initial_only}
    command, seconds = "python benchmarks/study_cost.py", time.perf_counter() - started
    write_results(chosen.output, {"scan": scan}, config, command, "MNI152 average", seconds)
    return 0


if __name__ == "__main__":
    sys.exit(main())
