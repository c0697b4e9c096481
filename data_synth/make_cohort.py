"""Make a synthetic cohort from a recipe.

    python data_synth/make_cohort.py data_synth/oasis_like.yaml build/cohorts/oasis_like --jobs 2

Stop it whenever you like: what is finished stays, what is not is never seen, and the same command goes on.
"""

import argparse
import os
import sys

# Before NumPy is loaded: one thread for each process, so that --jobs says how busy the machine is.
for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import torch  # noqa: E402
from tqdm import tqdm  # noqa: E402

from meshot.synth.cohorts import changed_files, keep_digests, make_cohort, open_cohort, read_recipe, visits  # noqa: E402


def parsed(words: list[str] | None) -> argparse.Namespace:
    """What was asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recipe", help="a YAML file, such as data_synth/oasis_like.yaml")
    parser.add_argument("folder", help="where the cohort shall be; a cohort that was begun there is gone on with")
    parser.add_argument("--jobs", type=int, default=1, help="processes that share the work (default: 1)")
    parser.add_argument("--subjects", type=int, help="how many template subjects, in place of the recipe's number")
    parser.add_argument("--days", type=int, help="how many days each subject is scanned on")
    parser.add_argument("--keep", metavar="FILE", help="afterwards, put the digests into this file of manifests")
    parser.add_argument("--check", action="store_true", help="make nothing; compare a cohort with its manifest")
    return parser.parse_args(words)


def main(words: list[str] | None = None) -> int:
    """Make what is missing, with a progress bar; 0 if all went well."""
    asked = parsed(words)
    torch.set_num_threads(1)
    try:
        changes = {key: value for key in ("subjects", "days") if (value := getattr(asked, key)) is not None}
        recipe = read_recipe(asked.recipe, **changes)
        if asked.check:
            changed = changed_files(asked.folder)
            print("\n".join(changed) if changed else "every file is as it was made")
            return int(bool(changed))
        missing, everything = len(open_cohort(recipe, asked.folder)), len(visits(recipe))
        made = make_cohort(recipe, asked.folder, asked.jobs)
        for name in tqdm(made, desc=recipe.name, total=everything, initial=everything - missing, unit="visit"):
            tqdm.write(f"{name} is ready")
        if asked.keep:
            keep_digests(asked.keep, asked.folder)
    except ValueError as error:
        print(f"make_cohort: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
