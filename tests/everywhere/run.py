"""Run the numerical tests as on other machines, and print a table: tests/everywhere/run.py [FILE ...].

Files and folders are named from ``tests/``. The exit status is 1 if a test fails on any of the machines.
"""

import argparse
import os
import sys

from machines import MACHINES, counts_of, run_tests

NUMERICAL = ["loss", "measure", "metrics", "mesh", "flow", "volume", "model"]
#: Drawn problems a loss: processors differ in rounding, which few problems show; ``make test`` draws more.
N_DRAWN = 100
IN_PARALLEL = ("-n", "logical", "--dist", "loadfile")


def main() -> int:
    """Run, print the table, and say what failed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="*", default=NUMERICAL)
    parser.add_argument("--machine", action="append", help="only those whose name contains this")
    chosen = parser.parse_args()
    machines = [m for m in MACHINES if not chosen.machine or any(part in m.name for part in chosen.machine)]
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    os.environ.setdefault("MESHOT_DRAWN", str(N_DRAWN))
    rows, failures = [], []
    for machine in machines:
        done = run_tests(machine, chosen.files, IN_PARALLEL)
        if done is None:
            rows.append((machine.name, "-", "-", f"this processor has no {machine.needs}"))
            print(f"{machine.name}: {rows[-1][-1]}", flush=True)
            continue
        found = counts_of(done.stdout)
        troubles = found.get("failed", 0) + found.get("error", 0) + found.get("errors", 0)
        well = done.returncode == 0 and found.get("passed", 0) > 0
        rows.append((machine.name, found.get("passed", 0), troubles, "ok" if well else "FAILED"))
        print(f"{machine.name}: {rows[-1][-1]}", flush=True)
        if not well:
            failures.append(f"\n{machine.name}, {machine.environment}\n{done.stdout}")
    print("\n".join(failures))
    print(f"\n{'machine':<26}{'passed':>8}{'failed':>8}")
    for name, passed, failed, verdict in rows:
        print(f"{name:<26}{passed:>8}{failed:>8}  {verdict}")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
