"""The house from the syntax tree: imports point downward only, and each third-party library has one home."""

import ast
from pathlib import Path

import pytest

RANKS = {
    "types": 0, "rng": 0, "errors": 0, "compressed": 0, "plain_yaml": 0, "files": 0, "scratch": 0, "threads": 0,
    "mesh": 1,
    "volume": 2, "measure": 2,
    "metrics": 3, "loss": 3,
    "flow": 4,
    "synth": 5, "model": 5,
    "pipeline": 6,
    "figures": 7, "teach": 7,
    "report": 8,
    "cli": 9,
}  # fmt: skip

#: Where a folder may import less than its rank allows.
NARROWER = {"metrics": {name for name, rank in RANKS.items() if rank == 0} | {"mesh", "volume"}}

#: Library -> the folders or modules (prefixes, relative to meshot) that may import it.
HOMES = {
    "trimesh": ("mesh/io",),
    "nibabel": ("mesh/io", "volume/io"),
    "SimpleITK": ("volume/registration",),
    "skimage": ("volume/",),
    "igl": ("mesh/", "metrics/"),
    "ot": ("loss/", "metrics/"),
    "geomloss": ("loss/", "metrics/"),
    "torchdiffeq": ("flow/integrate",),
    "nilearn": ("synth/anatomy",),
    "pyvista": ("figures/",),
    "vtk": ("figures/",),
    "vtkmodules": ("figures/",),
    "matplotlib": ("figures/",),
    "IPython": ("figures/",),
    "yaml": ("report/", "synth/recipe", "plain_yaml"),
}


def imported_modules(source: str) -> set[str]:
    """Full dotted names that a file imports, wherever in it."""
    names = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "relative imports hide the layer"
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def violations(package: Path) -> list[str]:
    found = []
    for file in sorted(package.rglob("*.py")):
        place = file.relative_to(package).as_posix()
        if place == "__init__.py":
            continue
        layer = place.split("/")[0].removesuffix(".py")
        if layer not in RANKS:
            found.append(f"{place}: no layer {layer}")
            continue
        for name in sorted(imported_modules(file.read_text(encoding="utf-8"))):
            found += _trouble(place, layer, name)
    return found


def _trouble(place: str, layer: str, name: str) -> list[str]:
    top, *rest = name.split(".")
    if top == "meshot":
        other = rest[0] if rest else "meshot"
        if other != layer and other not in NARROWER.get(layer, {o for o in RANKS if RANKS[o] <= RANKS[layer]}):
            return [f"{place} imports {name}"]
        sideways = other != layer and RANKS.get(other) == RANKS[layer] and RANKS[layer] > 0
        return [f"{place} imports its neighbour {name}"] if sideways else []
    if top in ("numba", "llvmlite") and not Path(place).name.startswith("_kernel"):
        return [f"{place} imports {top} outside a _kernel file"]
    if top in HOMES and not place.startswith(HOMES[top]):
        return [f"{place} imports {top}, whose home is {', '.join(HOMES[top])}"]
    return []


def test_the_house_stands(root):
    assert violations(root / "src" / "meshot") == []


@pytest.mark.parametrize(
    ("place", "line", "seen"),
    [
        ("mesh/a.py", "from meshot.loss.chamfer import chamfer", "imports meshot.loss"),
        ("mesh/a.py", "def f():\n    import meshot.flow", "imports meshot.flow"),
        ("metrics/a.py", "from meshot.measure.discrete import varifold", "imports meshot.measure"),
        ("loss/a.py", "from meshot.metrics import spread", "neighbour"),
        ("volume/a.py", "from meshot.measure import discrete", "neighbour"),
        ("flow/a.py", "from meshot import chamfer", "imports meshot.chamfer"),
        ("flow/a.py", "import torchdiffeq", "whose home"),
        ("loss/a.py", "import numba", "_kernel"),
        ("teach/a.py", "import matplotlib.pyplot as plt", "whose home"),
        ("corner/a.py", "x = 1", "no layer"),
    ],
)
def test_each_breach_is_seen(tmp_path, place, line, seen):
    file = tmp_path / place
    file.parent.mkdir(parents=True)
    file.write_text(line)
    (found,) = violations(tmp_path)
    assert seen in found


@pytest.mark.parametrize(
    ("place", "line"),
    [
        ("loss/_kernel_x.py", "import numba"),
        ("loss/a.py", "from meshot.measure.discrete import DiscreteMeasure\nimport ot"),
        ("mesh/a.py", "from meshot.errors import as_floating\nfrom meshot.mesh.mesh import Mesh\nimport igl"),
    ],
)
def test_what_is_allowed_passes(tmp_path, place, line):
    file = tmp_path / place
    file.parent.mkdir(parents=True)
    file.write_text(line)
    assert violations(tmp_path) == []
