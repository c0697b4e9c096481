"""Run the tests of the room that holds a mutant: what cosmic-ray calls in a copy of the checkout.

MESHOT_ORIGINAL names the checkout, by which the file that was changed is found. The exit status is that of the tests.
"""

import os
import subprocess
import sys
from pathlib import Path

#: Tests of other rooms that a room is tried by, besides its own.
MORE = {"measure": ["loss/test_values.py", "loss/test_axioms.py"], "mesh": ["metrics"]}


def changed_rooms(copy: Path, original: Path) -> set[str]:
    """The rooms of the package in which a Python file differs between two checkouts."""
    package = Path("src") / "meshot"
    return {
        path.relative_to(original / package).parts[0]
        for path in (original / package).rglob("*.py")
        if (copy / path.relative_to(original)).read_bytes() != path.read_bytes()
    }


def main() -> int:
    """Find the room and run its tests; all of them pass where nothing was changed."""
    here, original = Path.cwd(), Path(os.environ["MESHOT_ORIGINAL"])
    names = [name for room in sorted(changed_rooms(here, original)) for name in (room, *MORE.get(room, ()))]
    if not names:
        return 0
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider"]
    # Hash-based caches: a mutant may be as long as the original and as old, to the second.
    environment = os.environ | {"PYTHONPATH": str(here / "src"), "PYTHONDONTWRITEBYTECODE": "1"}
    return subprocess.run([*command, *(f"tests/{name}" for name in names)], env=environment, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
