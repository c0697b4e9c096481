"""Read many damaged files, and say which were not refused as they should be: tests/fuzz/run.py --files 5000."""

import argparse
import sys
from pathlib import Path

from fuzz_trial import content_of, trials


def main() -> int:
    """Print what was found wrong; 1 if anything was."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--files", type=int, default=5000)
    parser.add_argument("--first", type=int, default=0, help="the number of the first file, its seed")
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="write what was found wrong here")
    chosen = parser.parse_args()
    n_found = 0
    for number, said in trials(range(chosen.first, chosen.first + chosen.files)):
        n_found += 1
        print(f"file {number}: {said}", flush=True)
        if chosen.keep:
            chosen.keep.mkdir(parents=True, exist_ok=True)
            name, content = content_of(number)
            (chosen.keep / f"{number}_{name}").write_bytes(content)
    print(f"{chosen.files} files, {n_found} not refused as they should be")
    return bool(n_found)


if __name__ == "__main__":
    sys.exit(main())
