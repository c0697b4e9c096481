"""Rebuild chapters 8 and 10, and the rates of chapter 11: run four experiments, the ledger and the chapters.

Run as ``python experiments/rebuild_theorem.py``, on one thread. The recorded time of every part and their sum
are printed first. They were measured on a busy machine: ``convergence`` alone takes thirteen minutes on an idle core.
A stopped run can be resumed.
"""

import subprocess
import sys
from pathlib import Path

from meshot.provenance import read_results

HERE = Path(__file__).parent
EXPERIMENTS = ("convergence", "transport_rates", "encoding_rates", "beyond_random")
CHAPTERS = ("08_convergence", "10_beyond_the_theorem", "11_normals_and_gradients")


def main() -> int:
    """Run all parts in order. Returns the exit status of the first that fails, or 0."""
    seconds = {name: read_results(HERE / name / "results.json")["seconds"] for name in EXPERIMENTS}
    print(", ".join(f"{name} {value / 60:.0f} min" for name, value in seconds.items()), "as recorded;")
    print(f"all together {sum(seconds.values()) / 60:.0f} min, and three minutes for the chapters", flush=True)
    steps = [[str(HERE / name / "run.py")] for name in EXPERIMENTS]
    steps += [[str(HERE.parent / "book" / "make_ledger.py")]]
    steps += [[str(HERE.parent / "book" / "run_notebooks.py"), "store", *CHAPTERS]]
    for step in steps:
        print("python", *(Path(part).name for part in step), flush=True)
        status = subprocess.run([sys.executable, *step], check=False).returncode
        if status:
            return status
    return 0


if __name__ == "__main__":
    sys.exit(main())
