"""The scans of one split of one or more cohorts, and their placement on the standard grid."""

import os
from collections.abc import Sequence
from pathlib import Path

from meshot.synth.cohorts import Subject, read_recipe, scans
from meshot.types import PLACEMENTS, Placement


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


def placement_of(cohorts: Sequence[str | os.PathLike]) -> Placement:
    """What placed the scans of cohorts on the standard grid. Without a recipe, it was the registration of grey values.

    Raises
    ------
    ValueError
        If the cohorts differ in it.
    """
    recipes = {str(cohort): Path(cohort) / "recipe.yaml" for cohort in cohorts}
    found = {name: read_recipe(path).standard if path.is_file() else PLACEMENTS[0] for name, path in recipes.items()}
    if len(set(found.values())) > 1:
        each = ", ".join(f"{name} by {placement}" for name, placement in found.items())
        raise ValueError(
            f"scans are placed differently: {each}; train on cohorts with one placement; "
            "meshot make-cohort --standard chooses it"
        )
    return next(iter(found.values()), PLACEMENTS[0])
