"""Try a random sample of mutants with cosmic-ray, and print the survivors: tests/mutation/run.py [--sample 600].

The session is kept in build/mutation, and goes on there after a stop. Survivors that are known are listed with the
reason in survivors.yaml; the exit status is 1 if there is another one, or if less than nine tenths were killed.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from mutants import known_survivors, sampled, survivors_of

ROOT = Path(__file__).resolve().parents[2]
LEAST = 0.9


def main() -> int:
    """Make the session, draw the sample, try the mutants, report; the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sample", type=int, default=600)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--session", type=Path, default=ROOT / "build" / "mutation" / "session.sqlite")
    chosen = parser.parse_args()
    session = chosen.session.resolve()
    session.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        # Mutants are made in a copy of what tests need of a checkout.
        for part in ("src", "tests", "tools", "book"):
            shutil.copytree(ROOT / part, Path(folder) / part, ignore=shutil.ignore_patterns("__pycache__", ".*"))
        shutil.copy(ROOT / "pyproject.toml", folder)
        environment = os.environ | {
            "MESHOT_ORIGINAL": str(ROOT),
            "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
        }
        configuration = "tests/mutation/cosmic-ray.toml"

        def cosmic_ray(*words: str) -> None:
            command = [sys.executable, "-m", "cosmic_ray.cli", *words]
            subprocess.run(command, cwd=folder, env=environment, check=True)

        if not session.exists():
            cosmic_ray("init", configuration, str(session))
            n_mutants = sampled(session, chosen.sample, np.random.default_rng(chosen.seed))
            print(f"{min(chosen.sample, n_mutants)} of {n_mutants} mutants are tried", flush=True)
        cosmic_ray("exec", configuration, str(session))
    survivors, n_tried = survivors_of(session)
    known = known_survivors()
    new = [mutant for mutant in survivors if mutant.key not in known]
    for mutant in new:
        print(f"{mutant.file}:{mutant.line}, {mutant.operator}\n- {mutant.text}\n+ {mutant.change}\n")
    share = 1 - len(survivors) / max(n_tried, 1)
    print(f"{n_tried} mutants, {len(survivors)} survive, {len(new)} of them unknown: {100 * share:.1f} % killed")
    return int(bool(new) or share < LEAST)


if __name__ == "__main__":
    sys.exit(main())
