"""Train what is missing: trials of rates, then every system with its own rate, first at equal steps.

Run as ``python experiments/comparison/train.py`` when both cohorts and the segmentation weights exist. A stopped
training resumes, and on one CPU thread ends with the same weights. Options::

    --list                 show which trainings exist, and train nothing
    --only 'oasis_*ddot*'  train only those
    --jobs 2               train two at a time, each on one thread
    --device cuda          train on an accelerator
    --minutes 9            stop after so many minutes with status 75; the same command goes on
"""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1]))
from trials.train import run_trainings


def main(words: list[str] | None = None) -> int:
    """Train what is missing. Returns 1 if something failed or waits."""
    return run_trainings(__doc__, __file__, words)


if __name__ == "__main__":
    sys.exit(main())
