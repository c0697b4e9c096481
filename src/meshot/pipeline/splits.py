"""The scans of one split of one or more cohorts."""

import os
from collections.abc import Sequence

from meshot.synth.cohorts import Subject, scans


def scans_of(cohorts: Sequence[str | os.PathLike], split: str) -> list[Subject]:
    """All finished scans of a split, in the order of the cohorts.

    Raises
    ------
    ValueError
        If a folder is not a cohort, or no cohort has a scan in the split.
    """
    found = [subject for cohort in cohorts for subject in scans(cohort, split)]
    if not found:
        raise ValueError(f"no scan of the split {split!r} in {', '.join(map(str, cohorts)) or 'no cohort'}: make one")
    return found
