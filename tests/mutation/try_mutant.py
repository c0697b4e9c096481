"""Run the tests of the room that holds a mutant: what cosmic-ray calls in a copy of the checkout.

MESHOT_ORIGINAL names the checkout, by which the file that was changed is found. Test files that name it come first, so
that most mutants are killed within seconds. The exit status is that of the tests.
"""

import ast
import os
import subprocess
import sys
from pathlib import Path

#: Tests of other rooms that a room is tried by, besides its own.
MORE = {"measure": ["loss/test_values.py", "loss/test_axioms.py"], "mesh": ["metrics"]}
#: Drawn problems a loss: fewer than in the test suite, which is run once and not hundreds of times.
N_DRAWN = 50
#: Files that are run before the others are so much as imported: they kill most mutants.
N_NEAREST = 3


def changed_files(copy: Path, original: Path) -> list[Path]:
    """The Python files of the package that differ between two checkouts, from the top of the package."""
    package = Path("src") / "meshot"
    return sorted(
        path.relative_to(original / package)
        for path in (original / package).rglob("*.py")
        if (copy / path.relative_to(original)).read_bytes() != path.read_bytes()
    )


def public_names(file: Path) -> set[str]:
    """Functions and classes that a file defines for others, and the word that names the file."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    defined = {node.name for node in tree.body if isinstance(node, ast.FunctionDef | ast.ClassDef)}
    return {name for name in defined if not name.startswith("_")} | {file.stem.removeprefix("_kernel_").lstrip("_")}


def nearest_first(tests: list[Path], names: set[str]) -> list[Path]:
    """Test files in the order of how many of the names they contain; a name in that of the file counts most."""

    def nearness(test: Path) -> tuple[int, int]:
        text = test.read_text(encoding="utf-8")
        return -sum(name in test.stem for name in names), -sum(name in text for name in names)

    return sorted(tests, key=nearness)


def tests_of(changed: Path, original: Path) -> list[Path]:
    """The test files by which a change in a file of the package is tried, from ``tests/``, the nearest first."""
    folder, room = original / "tests", changed.parts[0]
    places = [folder / name for name in (room, *MORE.get(room, ()))]
    tests = [test for place in places for test in (sorted(place.rglob("test_*.py")) if place.is_dir() else [place])]
    ordered = nearest_first(tests, public_names(original / "src" / "meshot" / changed))
    return [test.relative_to(folder) for test in ordered]


def main() -> int:
    """Find the tests and run them until one fails; all of them pass where nothing was changed."""
    here, original = Path.cwd(), Path(os.environ["MESHOT_ORIGINAL"])
    tests = [test for changed in changed_files(here, original) for test in tests_of(changed, original)]
    if not tests:
        return 0
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider"]
    # Hash-based caches: a mutant may be as long as the original and as old, to the second.
    environment = os.environ | {"PYTHONPATH": str(here / "src"), "PYTHONDONTWRITEBYTECODE": "1"}
    environment.setdefault("MESHOT_DRAWN", str(N_DRAWN))
    for part in filter(None, (tests[:N_NEAREST], tests[N_NEAREST:])):
        words = [*command, *(f"tests/{test.as_posix()}" for test in part)]
        if code := subprocess.run(words, env=environment, check=False).returncode:
            return code
    return 0


if __name__ == "__main__":
    sys.exit(main())
