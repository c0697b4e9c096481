"""Write ``THIRD_PARTY.md``: every package of the lock with its version and its licence, from its own metadata.

``python tools/licences.py`` writes the table; ``--check`` compares it with the lock and prints the differences.
"""

import argparse
import contextlib
import importlib.metadata
import re
import sys
from pathlib import Path

from packaging.requirements import Requirement

from meshot.files import whole_file

ROOT = Path(__file__).resolve().parent.parent
LOCK, TABLE = ROOT / "requirements.lock", ROOT / "THIRD_PARTY.md"
NOT_HERE = "not installed where this table was made"
UNSTATED = "not stated"
LONGEST = 60
HEAD = """# Third-party packages

Meshes as Measures depends on the packages below and contains none of their code. `tools/licences.py` writes this table
from `requirements.lock` and from the metadata of the installed packages, and a test compares them. Packages for another
system or another Python are locked too, and say when they are installed.

The default build of torch for Linux also brings CUDA packages (`nvidia-*`, under NVIDIA's own licence) and `triton`
(MIT); the CPU build does not. The rendered book contains MathJax (Apache-2.0), taken from sphinx-mathjax-offline.
axe-playwright-python, a package of the tests, contains axe-core (MPL-2.0). The licences of
data stand in [limits and licences](book/limits.md).

| package | version | licence | installed |
|---|---|---|---|
"""


def locked_requirements(text: str) -> list[Requirement]:
    """The requirements of a lock, in its order. Each has exactly one version."""
    return [Requirement(line) for line in text.splitlines() if line.strip()]


def version_of(requirement: Requirement) -> str:
    """The version in a locked requirement."""
    (pin,) = requirement.specifier
    return pin.version


def licence_of(metadata: importlib.metadata.PackageMetadata) -> str:
    """A short form of a licence: the SPDX expression, else the classifiers, else the first line of a short text."""
    expression = metadata.get("License-Expression")
    if expression:
        return expression
    classifiers = [line.split("::")[-1].strip() for line in metadata.get_all("Classifier") or []
                   if line.startswith("License ::")]  # fmt: skip
    if classifiers:
        return ", ".join(sorted(classifiers))
    first = next(iter((metadata.get("License") or "").strip().splitlines()), "")
    return re.sub(r"\s+", " ", first) if 0 < len(first) <= LONGEST and first != "UNKNOWN" else UNSTATED


def licence_file_of(package: importlib.metadata.Distribution) -> str:
    """The title of the licence that a package comes with, such as MIT License."""
    for name in package.metadata.get_all("License-File") or ["LICENSE"]:
        text = package.read_text(f"licenses/{name}") or package.read_text(name) or ""
        first = next(iter(text.strip().splitlines()), "").strip()
        if "licen" in first.lower() and len(first) <= LONGEST:
            return first
    return UNSTATED


def known_licence(requirement: Requirement, before: dict[str, str]) -> str:
    """The licence of the locked version if it is installed, else the one in the old table, else a note."""
    if requirement.marker is None or requirement.marker.evaluate():
        with contextlib.suppress(importlib.metadata.PackageNotFoundError):
            package = importlib.metadata.distribution(requirement.name)
            if package.version.partition("+")[0] == version_of(requirement):
                stated = licence_of(package.metadata)
                return stated if stated != UNSTATED else licence_file_of(package)
    return before.get(requirement.name, NOT_HERE)


def rows_of(table: str) -> dict[str, tuple[str, ...]]:
    """The cells of a table, by name of the package."""
    cells = [tuple(cell.strip() for cell in line.strip("|").split("|")) for line in table.splitlines() if "|" in line]
    return {row[0]: row for row in cells[2:]}


def table_of(lock: str, before: str) -> str:
    """The whole page, from the lock and the old page."""
    licences = {name: row[2] for name, row in rows_of(before).items()}
    lines = []
    for requirement in locked_requirements(lock):
        when = str(requirement.marker).replace('"', "'") if requirement.marker else "always"
        lines.append(
            f"| {requirement.name} | {version_of(requirement)} | {known_licence(requirement, licences)} | {when} |\n"
        )
    return HEAD + "".join(lines)


def differences(old: str, new: str) -> list[str]:
    """The packages whose rows differ between two pages."""
    before, after = rows_of(old), rows_of(new)
    return sorted(name for name in before.keys() | after.keys() if before.get(name) != after.get(name))


def main(arguments: list[str] | None = None) -> int:
    """Write the table, or check it. Returns 1 if the check finds a difference, else 0."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true")
    check = parser.parse_args(arguments).check
    before = TABLE.read_text(encoding="utf-8") if TABLE.is_file() else ""
    after = table_of(LOCK.read_text(encoding="utf-8"), before)
    if check and before != after:
        print(f"THIRD_PARTY.md is not current ({', '.join(differences(before, after))}): python tools/licences.py")
        return 1
    if not check:
        with whole_file(TABLE) as temporary:
            temporary.write_text(after, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
