"""The house stands: imports point downward, through doors, and each third-party library has one home."""

import importlib

import pytest

from house import breaches, cells, outside_breaches, shown_names

SCRIPTS = ("experiments", "benchmarks", "book", "tools", "workflow")


def test_the_house_stands(root):
    assert breaches(root / "src") == []


@pytest.mark.parametrize("folder", SCRIPTS)
def test_scripts_come_by_the_doors(root, folder):
    found = {
        str(file.relative_to(root)): outside_breaches(root / "src", file.read_text(encoding="utf-8"))
        for file in sorted((root / folder).rglob("*.py"))
    }
    assert found
    assert {file: names for file, names in found.items() if names} == {}


def test_notebooks_come_by_the_doors(root):
    chapters = sorted((root / "notebooks").glob("[0-9]*.md"))
    code = {path.stem: cells(path.read_text(encoding="utf-8")) for path in chapters}
    assert all("import" in text for text in code.values())
    found = {name: outside_breaches(root / "src", text) for name, text in code.items()}
    assert {name: names for name, names in found.items() if names} == {}


def doors(root):
    return sorted((root / "src").rglob("__init__.pyi"))


def test_every_door_opens(root):
    for door in doors(root):
        room = importlib.import_module(".".join(door.parent.relative_to(root / "src").parts))
        missing = [name for name in shown_names(door) if not hasattr(room, name)]
        assert missing == [], door


def test_no_name_at_a_door_is_hidden_by_a_file(root):
    """A module of that name, once imported, would take the place of the function at the door."""
    hidden = {
        str(door): [n for n in shown_names(door) if (door.parent / n).is_dir() or (door.parent / f"{n}.py").is_file()]
        for door in doors(root)
    }
    assert {door: names for door, names in hidden.items() if names} == {}


@pytest.mark.parametrize(
    ("place", "line", "seen"),
    [
        ("meshot/mesh/a.py", "from meshot.loss import chamfer", "not below it"),
        ("meshot/mesh/a.py", "def f():\n    import meshot.flow", "not below it"),
        ("meshot/metrics/a.py", "from meshot.measure import varifold", "not below it"),
        ("meshot/loss/a.py", "from meshot.metrics import spread", "not below it"),
        ("meshot/volume/a.py", "from meshot.measure import discrete", "not below it"),
        ("meshot/flow/a.py", "from meshot import chamfer", "not below it"),
        ("meshot/flow/a.py", "import meshot", "not below it"),
        ("meshot/flow/a.py", "from meshot.loss.transport import chamfer", "past its door"),
        ("meshot/flow/a.py", "from meshot.loss import nearest", "past its door"),
        ("meshot/cli/a.py", "from meshot_book.notebook import table", "knows nothing of the book"),
        ("meshot_book/notebook/a.py", "from meshot_book.figures import x", "not below it"),
        ("meshot_book/figures/a.py", "from meshot.mesh.io import read_mesh", "past its door"),
        ("meshot/flow/a.py", "import torchdiffeq", "whose home"),
        ("meshot/loss/a.py", "import numba", "_kernel"),
        ("meshot/loss/a.py", "from . import sliced", "relative"),
        ("meshot/corner/a.py", "x = 1", "no layer"),
    ],
)
def test_each_breach_is_seen(tmp_path, place, line, seen):
    for room in ("meshot/loss/nearest", "meshot/mesh/io", "meshot_book/figures/x", place.removesuffix(".py")):
        file = (tmp_path / room).with_suffix(".py")
        file.parent.mkdir(parents=True, exist_ok=True)
        file.touch()
    (tmp_path / place).write_text(line)
    (found,) = breaches(tmp_path)
    assert seen in found


@pytest.mark.parametrize(
    ("place", "line"),
    [
        ("meshot/loss/_kernel_x.py", "import numba"),
        ("meshot/loss/a.py", "from meshot.measure import DiscreteMeasure\nimport ot"),
        ("meshot/mesh/a.py", "from meshot.errors import as_floating\nfrom meshot.mesh.mesh import Mesh\nimport igl"),
        ("meshot_book/figures/a.py", "from meshot.mesh import Mesh\nfrom meshot_book.notebook import table"),
    ],
)
def test_what_is_allowed_passes(tmp_path, place, line):
    file = tmp_path / place
    file.parent.mkdir(parents=True)
    for room in ("measure", "mesh"):
        (tmp_path / "meshot" / room).mkdir(parents=True, exist_ok=True)
    (tmp_path / "meshot_book" / "notebook").mkdir(parents=True, exist_ok=True)
    file.write_text(line)
    assert breaches(tmp_path) == []


def test_code_of_a_chapter_is_found():
    chapter = "Text\n\n```{code-cell} ipython3\n:tags: [a]\n\n%matplotlib inline\nimport meshot\n```\nText"
    assert "import meshot" in cells(chapter)
    assert "%" not in cells(chapter)


@pytest.mark.parametrize("line", ["from meshot.loss.transport import chamfer", "from meshot.loss import nearest"])
def test_a_script_past_a_door_is_seen(root, line):
    assert len(outside_breaches(root / "src", line)) == 1
    assert outside_breaches(root / "src", "from meshot.loss import chamfer\nfrom meshot.errors import x") == []
