"""Kill everything that writes, at random moments: tests/kills/run.py [NAME ...] [--kills 20] [--sample].

Besides, two runs on one folder, a folder that cannot be written to, and a disk that is full. The exit status is 1 if
anything half-written was found, or a second start did not end as a whole run does.
"""

import argparse
import os
import sys
import tempfile
from pathlib import Path

os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")
HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent.parent / "book")]

from kill_trials import Writer, trials, whole_run  # noqa: E402
from kill_writers import EVERY, NEEDS_COHORT, SAMPLE, make_inputs, warm  # noqa: E402


def main() -> int:
    """Kill, and print what was found; the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help=f"of {', '.join(writer.name for writer in EVERY)}; all if left out")
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--sample", action="store_true", help="the cheap ones only")
    chosen = parser.parse_args()
    writers = [w for w in (SAMPLE if chosen.sample else EVERY) if not chosen.names or w.name in chosen.names]
    n_wrong = 0
    warm()
    with tempfile.TemporaryDirectory() as folder:
        inputs = Path(folder) / "cohort"
        if any(writer.name in NEEDS_COHORT for writer in writers):
            whole_run(Writer("inputs", lambda out, _: make_inputs(out)), inputs, inputs)
        for writer in writers:
            found = list(trials(writer, inputs, chosen.kills, chosen.seed))
            n_wrong += bool(found)
            print("\n".join(f"{writer.name}: {trouble}" for trouble in found))
            print(f"{writer.name}: {chosen.kills} kills, {len(found)} troubles", flush=True)
    return int(bool(n_wrong))


if __name__ == "__main__":
    sys.exit(main())
