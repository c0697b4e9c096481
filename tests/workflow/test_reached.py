"""The code that a script reaches: edits that change no number keep the digest, others change exactly the dependents."""

import sys

import pytest
import yaml

from refusals import refuses
from scripts import scripts_in

PACKAGE = {
    "pack/__init__.py": "import lazy_loader\n__getattr__, _, __all__ = lazy_loader.attach_stub(__name__, __file__)\n",
    "pack/__init__.pyi": "from .inner.affine import register as register\n"
    "from .shapes import ball as ball, Ball as Ball",
    "pack/inner/__init__.py": "",
    "pack/inner/affine.py": (
        '"""Affine maps."""\nfrom pack.inner import steps\n\nSTEPS = {"x": 3}\n\n\n'
        'def register(x: int) -> int:\n    """The map."""\n    # A remark.\n    return steps.taken(x, STEPS["x"])\n'
    ),
    "pack/inner/steps.py": (
        "TABLE = []\nTABLE.append(1)\n\n\ndef taken(x, n):\n    return x * n\n\n\ndef unused(x):\n    return x\n"
    ),
    "pack/shapes.py": (
        "class Base:\n    def grow(self):\n        from pack.inner.steps import taken as grown\n"
        "\n        return grown(1, 2)\n"
        "\n\nclass Ball(Base):\n    pass\n\n\ndef ball():\n    return 1\n"
    ),
    "affine_run.py": "import numpy as np\nfrom pack import register as registered\n\nprint(registered(np.ones(1)))\n",
    "door_run.py": "import pack\n\n\ndef main():\n    return pack.Ball().grow()\n",
    "plain_run.py": "from pack import ball\n\nif __name__ == '__main__':\n    print(ball())\n",
}
RUNS = ("affine_run", "door_run", "plain_run")


@pytest.fixture
def place(tmp_path):
    for name, text in PACKAGE.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


@pytest.fixture
def digests(part, place):
    return lambda: {name: part("reached").Code(place).digest([name]) for name in RUNS}


def edit(place, name, old, new):
    text = (place / name).read_text(encoding="utf-8")
    assert old in text
    (place / name).write_text(text.replace(old, new), encoding="utf-8")


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("pack/inner/affine.py", "# A remark.", "# Another."),
        ("pack/inner/affine.py", "The map", "Another"),
        ("pack/inner/affine.py", "Affine maps", "Another"),
        ("pack/inner/affine.py", "x: int", "x: float"),
        ("pack/inner/affine.py", "-> int", "-> float"),
        ("pack/inner/affine.py", "return steps.taken(", "return steps.taken(\n        "),
        ("pack/inner/steps.py", "return x\n", "return -x\n"),
        ("pack/inner/affine.py", "from pack.inner import steps", "import pack.inner.steps as steps"),
    ],
)
def test_what_changes_no_number_keeps_every_digest(place, digests, name, old, new):
    before = digests()
    edit(place, name, old, new)
    assert digests() == before


@pytest.mark.parametrize(
    ("name", "old", "new", "dependents"),
    [
        ("pack/inner/affine.py", "return steps", "return -steps", {"affine_run"}),
        ("pack/inner/affine.py", '"x": 3', '"x": 4', {"affine_run"}),
        ("pack/inner/steps.py", "x * n", "x + n", {"affine_run", "door_run"}),
        ("pack/inner/steps.py", "append(1)", "append(2)", {"affine_run", "door_run"}),
        ("pack/shapes.py", "grown(1, 2)", "grown(2, 1)", {"door_run"}),
        ("pack/shapes.py", "return 1\n", "return 2\n", {"plain_run"}),
        ("pack/__init__.pyi", "ball as ball", "Ball as ball", {"plain_run"}),
        ("plain_run.py", "ball()", "2 * ball()", {"plain_run"}),
        ("affine_run.py", "np.ones(1)", "np.ones(2)", {"affine_run"}),
    ],
)
def test_a_change_reaches_exactly_what_depends_on_it(place, digests, name, old, new, dependents):
    before = digests()
    edit(place, name, old, new)
    after = digests()
    assert {run for run in RUNS if after[run] != before[run]} == dependents


def test_code_that_moves_keeps_its_digest(place, digests):
    before = digests()
    steps = place / "pack/inner/steps.py"
    moved = place / "pack/moved.py"
    moved.write_text(steps.read_text(encoding="utf-8"), encoding="utf-8")
    steps.unlink()
    edit(place, "pack/inner/affine.py", "from pack.inner import steps", "from pack.moved import taken")
    edit(place, "pack/inner/affine.py", "steps.taken", "taken")
    edit(place, "pack/shapes.py", "from pack.inner.steps import taken as grown", "from pack import moved")
    edit(place, "pack/shapes.py", "grown(1, 2)", "moved.taken(1, 2)")
    assert digests() == before


def test_what_is_imported_for_a_type_checker_only_does_not_count(place, digests):
    before = digests()
    edit(place, "pack/inner/steps.py", "TABLE = []", "if TYPE_CHECKING:\n    import pack\nTABLE = []")
    assert digests() == before


def test_a_package_may_import_its_own_modules_by_its_name(part, place):
    (place / "pack/inner/__init__.py").write_text("from pack.inner import steps\n")
    assert "taken" in {found.name for found in part("reached").Code(place).reached(["affine_run"])}


def test_the_trainings_of_experiments_count_and_their_runner_does_not(part, tmp_path):
    files = {"x/run.py": "import experiment\nfrom trials.train import go\ngo(experiment.run())\n",
             "trials/__init__.py": "", "trials/train.py": "def go(n):\n    return n\n",
             "experiment.py": "def run():\n    return 1\n"}  # fmt: skip
    for name, text in files.items():
        (tmp_path / "experiments" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "experiments" / name).write_text(text)
    stale = part("stale")

    def digest():
        return stale.Results(None, tmp_path, tmp_path)._code(("experiments/x/run.py",))

    before = digest()
    edit(tmp_path, "experiments/experiment.py", "return 1", "return 2")
    assert digest() == before
    edit(tmp_path, "experiments/trials/train.py", "return n", "return -n")
    assert digest() != before


def test_a_name_that_is_none_is_refused(part, place):
    code = part("reached").Code(place)
    assert code.digest(["pack.inner.affine.register"]) == code.digest(["pack.register"])
    for name in ("pack.nothing", "numpy.ones", "nothing"):
        refuses(f"there is no code {name}; name a module, or what a door shows", code.digest, [name])


def test_all_that_runs_is_in_the_digest(part, root, tmp_path):
    """Functions of ours that an experiment calls, seen while it runs, are among those found from its text."""
    folder, called = root / "experiments" / "ground_cost", set()
    sources = (str(folder), str(root / "src"))

    def note(frame, event, _):
        code = frame.f_code
        if event == "call" and code.co_filename.startswith(sources) and not code.co_name.startswith("<"):
            called.add((code.co_filename, code.co_qualname.partition(".")[0]))

    with scripts_in(folder) as load:
        run = load("run")
        config = yaml.safe_load((folder / "config.yaml").read_text(encoding="utf-8"))
        sys.setprofile(note)
        try:
            run.row_of((2, 0), config | {"n_turns": 1})
        finally:
            sys.setprofile(None)
    code = part("reached").Code
    reached = code(folder, code(root / "src")).reached(["run"])
    found = {(place.module.rpartition(".")[2], place.name) for place in reached}
    ours = {(file.rpartition("/")[2].removesuffix(".py"), name) for file, name in called}
    assert len(ours) > 5
    assert ours - found == set()
