"""The three lists of dependencies agree: every dependency, every range."""

import re
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
    project = tomllib.loads((root / "pyproject.toml").read_text())["project"]
    lines = [*project["dependencies"], *(line for extra in project["optional-dependencies"].values() for line in extra)]
    requirements = [Requirement(line) for line in lines]
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
    assert disagreements(declared(root), conda_requirements((root / "environment.yml").read_text())) == []


def test_lock_holds_every_dependency_within_its_range(root):
    versions = locked((root / "requirements.lock").read_text())
    for name, requirement in declared(root).items():
        assert versions.get(name), f"{name} is not locked: make lock"
        assert all(requirement.specifier.contains(version) for version in versions[name]), name
    assert "setuptools" in versions, "the package is installed without build isolation"


def test_lock_names_no_host_and_no_cuda(root):
    text = (root / "requirements.lock").read_text()
    assert not re.search(r"://|--|@ ", text)
    assert not re.search(r"^(nvidia|cuda|triton)", text, re.MULTILINE)


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


def test_the_package_imports_what_it_declares_and_nothing_else(root):
    project = tomllib.loads((root / "pyproject.toml").read_text())["project"]
    names = [canonicalize_name(Requirement(line).name) for line in project["dependencies"]]
    wanted = {IMPORT_NAMES.get(name, name) for name in names}
    used = set()
    for file in (root / "src").rglob("*.py"):
        used |= {module.split(".")[0] for module, _ in imports(file.read_text(encoding="utf-8"))}
    assert used - STANDARD - wanted == set(), "imported, but not declared"
    assert wanted - used - {"tqdm"} == set(), "declared, but not imported"


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [("numpy >=2.1,<3", "numpy >=2.0,<3", ["numpy"]), ("  - tqdm >=4.66,<5\n", "", ["tqdm"])],
)
def test_a_difference_is_seen(root, old, new, expected):
    text = (root / "environment.yml").read_text()
    assert old in text
    assert disagreements(declared(root), conda_requirements(text.replace(old, new))) == expected
