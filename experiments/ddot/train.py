"""Train the missing networks of the experiment, starting with those for the fair pairs.

Run as ``python experiments/ddot/train.py`` when both cohorts and the segmentation weights exist. ``--jobs 2`` trains
two networks at a time, each on one thread; ``--only 'oasis_like_left_*_0'`` selects networks; ``--list`` shows their
status; ``--device cuda`` trains on an accelerator. A stopped training resumes, and on a CPU ends with the same weights.
"""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1]))
from trials.train import run_trainings


def main(words: list[str] | None = None) -> int:
    """Train the missing networks. Returns 1 if one failed."""
    return run_trainings(__doc__, __file__, words)


if __name__ == "__main__":
    sys.exit(main())
