"""``meshot make-cohort RECIPE OUT``."""

import argparse
import os
from pathlib import Path

from meshot.cli.common import COUNT, FILE, NOTE, Commands, add_command


def add_to(commands: Commands) -> None:
    """Add the command ``make-cohort`` and its arguments to the parser."""
    command = add_command(
        commands,
        "make-cohort",
        "Make synthetic scans with known surfaces.",
        "The command makes a synthetic cohort from a recipe: scans, their true surfaces, and a manifest with the "
        f"checksum of every file. If it was stopped, the same command resumes. {NOTE}",
        """
        meshot make-cohort tiny build/cohorts/tiny
        meshot make-cohort oasis_like build/cohorts/oasis_like --jobs 2
        meshot make-cohort oasis_like build/cohorts/oasis_like --check
        """,
        "Recipes in the package are oasis_like, adni_like, test_retest, people_like and tiny.",
    )
    command.add_argument("recipe", help="The name of a recipe in the package, or a YAML file.")
    command.add_argument("folder", type=Path, help="The folder of the cohort, new or unfinished.")
    command.add_argument("--jobs", **COUNT, default=1, help="Run this many processes (default: %(default)s).")
    command.add_argument(
        "--subjects", **COUNT, help="Make this many subjects from the template (default: as many as the recipe states)."
    )
    command.add_argument(
        "--held-out",
        **COUNT,
        dest="held_out_subjects",
        help="Make this many more subjects from the template, all for testing (default: as many as the recipe "
        "states). All other subjects stay as they are.",
    )
    command.add_argument(
        "--days", **COUNT, help="Scan each subject on this many days (default: as many as the recipe states)."
    )
    command.add_argument(
        "--standard", metavar="WHAT", help="Place scans by 'grey values' or 'white matter' (default: as in the recipe)."
    )
    command.add_argument("--keep", **FILE, help="Add the checksums to this file of manifests.")
    command.add_argument(
        "--check",
        action="store_true",
        help="Make nothing, but compare the cohort with its manifest. The exit status is 1 if a file differs.",
    )
    command.set_defaults(run=_run)


def _run(chosen: argparse.Namespace) -> int:
    # Set before NumPy is imported: one thread per process, so that --jobs alone decides how many cores are used.
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
        os.environ.setdefault(variable, "1")
    import torch
    from tqdm import tqdm

    from meshot.synth import changed_files, keep_digests, make_cohort, open_cohort, read_recipe, visits

    torch.set_num_threads(1)
    given = {name: getattr(chosen, name) for name in ("subjects", "held_out_subjects", "days", "standard")}
    recipe = read_recipe(chosen.recipe, **{name: value for name, value in given.items() if value is not None})
    if chosen.check:
        changed = changed_files(chosen.folder)
        print("\n".join(changed) if changed else "every file is as it was made")
        return int(bool(changed))
    missing, everything = len(open_cohort(recipe, chosen.folder)), len(visits(recipe))
    made = make_cohort(recipe, chosen.folder, chosen.jobs)
    for name in tqdm(made, desc=recipe.name, total=everything, initial=everything - missing, unit="visit"):
        tqdm.write(f"{name} is ready")
    if chosen.keep:
        keep_digests(chosen.keep, chosen.folder)
    return 0
