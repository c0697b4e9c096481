"""The annotations of the live modules are checked by TypeScript, within Deno, and the check refuses what is wrong."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

#: Folders that import from each other.
FOLDERS = ("meshot/view/assets", "meshot_book/figures/assets", "meshot_book/live")
#: File, what stands there, and what would be wrong.
MUTANTS = [
    ("assets/transport.js", "plan.push([first[i], second[j], mass]);", "plan.push([first[i], second[j]]);"),
    ("assets/flow.js", "steps: before.steps + 1,", "steps: `${before.steps} and one`,"),
    ("figures/assets/sorting.js", 'pairing: "sorted",\n    draw: 7,', 'pairing: "sorted",\n    draw: "seven",'),
    ("figures/assets/turning.js", '{ kind: "range", key: "count"', '{ kind: "slider", key: "count"'),
    ("figures/assets/rates.js", "{ p: state.p }", "{ power: state.p }"),
]


@pytest.fixture(scope="module")
def copied(root, tmp_path_factory):
    """A copy of the scripts, and its check."""
    place = tmp_path_factory.mktemp("types")
    shutil.copy(root / "deno.json", place)
    for folder in FOLDERS:
        shutil.copytree(root / "src" / folder, place / folder, ignore=shutil.ignore_patterns("*.py*"))
    deno = shutil.which("deno", path=os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]]))

    def check():
        settings = os.environ | {"DENO_DIR": str(place / "cache"), "DENO_NO_UPDATE_CHECK": "1", "NO_COLOR": "1"}
        command = [deno, "check", "--quiet", "meshot_book/live"]
        return subprocess.run(command, cwd=place, env=settings, capture_output=True, text=True)

    return place / "meshot_book/live", check


def test_the_types_are_right(copied):
    found = copied[1]()
    assert found.returncode == 0, found.stderr


@pytest.mark.parametrize(("file", "right", "wrong"), MUTANTS)
def test_a_wrong_type_is_refused(file, right, wrong, copied):
    folder, check = copied
    text = (folder / file).read_text(encoding="utf-8")
    assert text.count(right) == 1
    try:
        (folder / file).write_text(text.replace(right, wrong), encoding="utf-8")
        found = check()
        assert found.returncode != 0
        assert re.search(r"^TS\d+ \[ERROR\]", found.stderr, re.MULTILINE), found.stderr
    finally:
        (folder / file).write_text(text, encoding="utf-8")
