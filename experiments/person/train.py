"""Train the networks of the package on synthetic heads: one command, from the cohorts to the weights.

Run as ``python experiments/person/train.py``. The steps are three cohorts, the segmentation network on the first of
them, its adaptation to all three, and the flow of each side with the windowed loss. A step that is finished is skipped,
and one that was stopped resumes. ``--list`` prints the steps; ``--jobs 2`` uses two cores. Nobody's scan is among the
training data.
"""

import argparse
import dataclasses
import os
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

from meshot.anatomy import HEMISPHERES

FOLDER = Path("build/people")
COHORTS = {"people_like": "cohort", "oasis_like": "oasis_like", "adni_like": "adni_like"}  # folders by recipe
PLACEMENT = "white matter"
ADAPTATION = "training.n_epochs=10"
SECONDS_BETWEEN_LOOKS = 1.0


@dataclasses.dataclass(frozen=True)
class Step:
    """A command of ``meshot``, with its words and the last file that it writes: if that is there, it is finished."""

    name: str
    words: tuple[str, ...]
    makes: Path


def stages(folder: Path, jobs: int = 1, precision: str = "float32", subjects: int | None = None) -> list[list[Step]]:
    """The steps in their order. Those of one stage need nothing of each other."""
    fewer = () if subjects is None else ("--subjects", str(subjects))
    made = ("--standard", PLACEMENT, "--jobs", str(jobs), *fewer)
    cohorts = [folder / name for name in COHORTS.values()]
    first, weights = (folder / name / "segmentation.safetensors" for name in ("segmentation", "adapted"))
    on_cpu = ("--device", "cpu", "--threads")
    segmentation = ("train-segmentation", "people", *on_cpu, str(jobs), "--set", f"training.precision={precision}")
    adapted = (*segmentation, ADAPTATION, "--data", *map(str, cohorts), "-o", str(weights.parent))
    flow = ("train", "windows", "shipped", *on_cpu, "1", "--data", *map(str, cohorts), "-o", str(folder / "windows"))
    flow += ("--segmentation", str(weights), "--initial", str(folder / "initial"))
    return [
        *(
            [Step(recipe, ("make-cohort", recipe, str(each), *made), each / "manifest.json")]
            for recipe, each in zip(COHORTS, cohorts)
        ),
        [
            Step(
                "segmentation", (*segmentation, "--data", str(cohorts[0]), "-o", str(first.parent)),
                first.with_suffix(".png"),
            )
        ],
        [Step("adaptation", (*adapted, "--start", str(first)), weights.with_suffix(".png"))],
        [
            Step(
                f"flow, {side}", (*flow, "--set", f"training.side={side}"), folder / "windows" / f"{side}_white.png"
            )
            for side in HEMISPHERES
        ],
    ]  # fmt: skip


def run_stage(steps: list[Step], jobs: int) -> int:
    """Run the unfinished steps of a stage, at most ``jobs`` at once. Returns the exit status of a failed one, or 0."""
    waiting, running = [step for step in steps if not step.makes.is_file()], []
    try:
        while waiting or running:
            while waiting and len(running) < jobs:
                running.append(_started(waiting.pop(0), 1 if len(steps) > 1 else jobs))
            time.sleep(SECONDS_BETWEEN_LOOKS)
            failed = [process.returncode for process in running if process.poll()]
            if failed:
                return failed[0]
            running = [process for process in running if process.poll() is None]
    finally:
        for process in running:
            process.terminate()
            process.wait()
    return 0


def _started(step: Step, n_threads: int) -> subprocess.Popen:
    print(f"{step.name}: meshot {shlex.join(step.words)}", flush=True)
    threads = dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), str(n_threads))
    return subprocess.Popen([sys.executable, "-m", "meshot", *step.words], env=os.environ | threads)


def main(words: list[str] | None = None) -> int:
    """Do what is missing. Returns the exit status of a step that failed, or 0."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, default=FOLDER, help="folder of everything (default: %(default)s)")
    parser.add_argument("--jobs", type=int, default=1, help="processor cores (default: %(default)s)")
    parser.add_argument("--subjects", type=int, help="number of heads (default: that of the recipe)")
    parser.add_argument("--precision", default="float32", help="bfloat16 where the processor multiplies it in hardware")
    parser.add_argument("--list", action="store_true", help="print the steps, and which are finished")
    asked = parser.parse_args(words)
    plan = stages(asked.output, asked.jobs, asked.precision, asked.subjects)
    if asked.list:
        for step in (step for stage in plan for step in stage):
            print(f"{'there' if step.makes.is_file() else 'missing':8} {step.name}: meshot {shlex.join(step.words)}")
        return 0
    # On SIGTERM, exit normally, so that child processes are stopped too.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    for stage in plan:
        status = run_stage(stage, asked.jobs)
        if status:
            return status
    print(f"weights in {asked.output / 'adapted'} and {asked.output / 'windows'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
