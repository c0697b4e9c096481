"""The three lists of dependencies agree: every dependency, every range."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from house import imports

#: What conda-forge calls a distribution by another name than PyPI.
CONDA_NAMES = {"torch": "pytorch-cpu", "libigl": "igl"}
CONDA_ONLY = {"python", "pip", "make", "setuptools"}


def declared(root: Path) -> dict[str, Requirement]:
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    lines = [*project["dependencies"], *(line for extra in project["optional-dependencies"].values() for line in extra)]
    requirements = [r for r in map(Requirement, lines) if r.name != "meshot"]  # an extra may hold another
    assert len({canonicalize_name(r.name) for r in requirements}) == len(requirements), "a dependency is declared twice"
    return {canonicalize_name(r.name): r for r in requirements}


def conda_requirements(text: str) -> dict[str, Requirement]:
    back = {conda: pypi for pypi, conda in CONDA_NAMES.items()}
    entries = yaml.safe_load(text)["dependencies"]
    lines = [entry for entry in entries if isinstance(entry, str)]
    lines += next(entry["pip"] for entry in entries if isinstance(entry, dict))
    found = [Requirement(line) for line in lines]
    return {canonicalize_name(back.get(r.name, r.name)): r for r in found if r.name not in CONDA_ONLY}


def locked(text: str) -> dict[str, list[str]]:
    versions: dict[str, list[str]] = {}
    for line in text.splitlines():
        requirement = Requirement(line)
        (pin,) = requirement.specifier
        assert pin.operator == "==", f"{line}: not exact"
        versions.setdefault(canonicalize_name(requirement.name), []).append(pin.version)
    return versions


def disagreements(wanted: dict[str, Requirement], others: dict[str, Requirement]) -> list[str]:
    """Names on one side only, and names whose ranges differ."""
    alone = sorted(set(wanted) ^ set(others))
    differing = [name for name in wanted.keys() & others.keys() if wanted[name].specifier != others[name].specifier]
    return alone + sorted(differing)


def test_conda_and_pyproject_agree(root):
    assert (
        disagreements(declared(root), conda_requirements((root / "environment.yml").read_text(encoding="utf-8"))) == []
    )


def test_lock_holds_every_dependency_within_its_range(root):
    versions = locked((root / "requirements.lock").read_text(encoding="utf-8"))
    for name, requirement in declared(root).items():
        assert versions.get(name), f"{name} is not locked: make lock"
        assert all(requirement.specifier.contains(version) for version in versions[name]), name
    assert "setuptools" in versions, "the package is installed without build isolation"


def test_lock_names_no_host_and_no_cuda(root):
    text = (root / "requirements.lock").read_text(encoding="utf-8")
    assert not re.search(r"://|--|@ ", text)
    assert not re.search(r"^(nvidia|cuda|triton)", text, re.MULTILINE)


def unlisted(lock: str, table: str) -> set[str]:
    """Packages that the table of licences lacks (unless only some systems need them) or has in another version."""
    rows = dict(re.findall(r"^\| (\S+) +\| (\S+) ", table, re.MULTILINE))
    del rows["Name"]
    listed = {canonicalize_name(name): version.partition("+")[0] for name, version in rows.items()}
    versions = locked(lock)
    everywhere = {canonicalize_name(r.name) for r in map(Requirement, lock.splitlines()) if r.marker is None}
    return (everywhere - listed.keys()) | {name for name in listed if listed[name] not in versions.get(name, [])}


def test_licences_are_listed_for_every_locked_package(root):
    lock, table = ((root / name).read_text(encoding="utf-8") for name in ("requirements.lock", "THIRD_PARTY.md"))
    assert unlisted(lock, table) == set(), "make licences"
    assert unlisted(lock.replace("numpy==", "numpy==9."), table) == {"numpy"}
    assert unlisted(lock.replace("tqdm==", "tkdm=="), table) == {"tkdm", "tqdm"}


#: What is imported by another name than it is installed.
IMPORT_NAMES = {
    "simpleitk": "SimpleITK",
    "pot": "ot",
    "libigl": "igl",
    "scikit-image": "skimage",
    "pyyaml": "yaml",
    "lazy-loader": "lazy_loader",
}
#: What needs no declaration: Python's own, ourselves, and VTK, which is pyvista's.
STANDARD = sys.stdlib_module_names | {"meshot", "meshot_book", "vtkmodules"}


#: What an installation without extras has to do with: losses, measures, meshes, flows, the ruler.
PLAIN = ("measure", "mesh", "metrics", "loss", "flow", "model")


def import_names(lines: list[str]) -> set[str]:
    names = [canonicalize_name(Requirement(line).name) for line in lines]
    return {IMPORT_NAMES.get(name, name) for name in names}


def test_the_package_imports_what_it_declares_and_nothing_else(root):
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    wanted = import_names(project["dependencies"] + extras["cortex"] + extras["bids"])
    used = set()
    for file in (root / "src").rglob("*.py"):
        used |= {module.split(".")[0] for module, _ in imports(file.read_text(encoding="utf-8"))}
    assert used - STANDARD - wanted == set(), "imported, but not declared"
    assert wanted - used - {"tqdm"} == set(), "declared, but not imported"


def run_without(names: set[str], code: str) -> subprocess.CompletedProcess:
    """Run code as in an installation that lacks some libraries."""
    code = f"import sys; sys.modules.update(dict.fromkeys({sorted(names)}))\n{code}"
    return subprocess.run([sys.executable, "-c", code], capture_output=True, encoding="utf-8", check=False)


OPEN_EVERYTHING = """
import importlib, meshot
for name in set(dir(meshot)) - {others}:  # a room whose own door needs an extra names it: see below
    getattr(meshot, name)
for name in {rooms}:
    room = importlib.import_module(name)
    for shown in room.__all__:
        getattr(room, shown)
"""
SAY_WHAT_FAILS = """
import importlib
from pathlib import Path
for place in {places}:
    room, name = place.rsplit(".", 1)
    try:
        found = getattr(importlib.import_module(room), name)
        if name == "parsed_yaml":  # losses have settings, too, so that only the reading of a text needs the library
            found("")
        if name == "visits_of_bids":  # files that are no data set need it not
            found(Path({sample!r}))
    except ImportError as error:
        print(error)
"""
#: What needs a library of an extra, and the extra.
NEEDED = {
    "meshot.volume.register_affine": "cortex",
    "meshot.volume.isosurface": "cortex",
    "meshot.anatomy.mni152_t1": "cortex",
    "meshot.settings.parsed_yaml": "cortex",
    "meshot.view.style": "cortex",
    "meshot.study.visits_of_bids": "bids",
}


def lacking(root: Path, *extras: str) -> set[str]:
    stated = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    return import_names([line for extra in extras for line in stated[extra]])


def test_losses_need_no_extra(root):
    missing = lacking(root, "cortex", "bids")
    others = {place.parent.name for place in (root / "src" / "meshot").glob("*/__init__.py")} - set(PLAIN)
    done = run_without(missing, OPEN_EVERYTHING.format(rooms=[f"meshot.{room}" for room in PLAIN], others=others))
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("extra", ["cortex", "bids"])
def test_what_needs_an_extra_names_it(root, extra):
    places, missing = [place for place, needed in NEEDED.items() if needed == extra], lacking(root, extra)
    said = run_without(
        missing, SAY_WHAT_FAILS.format(places=places, sample=str(root / "data_synth" / "sample"))
    ).stdout.splitlines()
    assert len(said) == len(places)
    for line in said:
        assert line.split()[0].partition(".")[0] in missing
        assert line.endswith(f"pip install 'meshot[{extra}]'")


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [("numpy >=2.1,<3", "numpy >=2.0,<3", ["numpy"]), ("  - tqdm >=4.66,<5\n", "", ["tqdm"])],
)
def test_a_difference_is_seen(root, old, new, expected):
    text = (root / "environment.yml").read_text(encoding="utf-8")
    assert old in text
    assert disagreements(declared(root), conda_requirements(text.replace(old, new))) == expected
