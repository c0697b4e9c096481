"""Two editions of the notebooks as zip files that need nothing else: ``python book/editions.py [--into FOLDER]``.

``student``     solutions, answers and quiz explanations out; nothing was run; checkers compare with expected answers
``instructor``  everything in, with the notes for the board from the teaching guide at the head of each chapter, the
                quizzes for learning platforms, and the chapters once more as assignments for nbgrader

Each holds the notebooks, the results that they read, the wheel of the package, requirements, and a page to start with.
"""

import argparse
import ast
import re
import shutil
import subprocess
import sys
import tempfile
import textwrap
import zipfile
from collections.abc import Mapping
from pathlib import Path

from kernels import SeparateKernelManager  # noqa: F401  isort: skip: before nbformat
import jinja2
import nbformat

from meshot.files import whole_file
from meshot_book.exercises import check
from meshot_book.notebook import CHECKSUMS
from plain import CHAPTERS, PUBLISHED, plain_notebook
from quiz_files import quiz_files
from run_notebooks import retold_notebook

ROOT = Path(__file__).resolve().parent.parent
EXPERIMENTS = ROOT / "experiments"
YOUR_TURN = "*The solution is in the instructor edition.*"
#: Sentences of the chapters that speak of what students do not have -> those of their edition.
_FOR_STUDENTS = (
    (re.compile(r"^:::\{dropdown\} Answers\n.*?^:::$", re.M | re.S), "*The answers are in the instructor edition.*"),
    (re.compile(r"\b(?:The s|S)olutions are folded\."), "The solutions are in the instructor edition."),
    (re.compile(r", and each answer is explained\."), ". The answers are in the instructor edition."),
)
_OF_SOLUTION = re.compile(r"^.*\bthe solution\b.*\n?", re.M | re.I)
_BOARD = re.compile(r"^- \*\*(\d\d)\*\*: (.*?)(?=^- \*\*\d\d\*\*|\Z|^#)", re.M | re.S)
_CHECK = re.compile(r"^check\.(\w+)\(\w+\)\Z", re.M)
#: The package lies beside these lines in a zip.
REQUIREMENTS = "-c constraints.txt\n./{wheel}[bids,cortex]\njupyterlab\n"


def board_notes(guide: str) -> dict[str, str]:
    """The notes for the board of each chapter, by its two digits."""
    _, found, rest = guide.partition("## On the board")
    if not found:
        raise ValueError("the teaching guide has no section 'On the board'")
    section = rest.split("\n## ")[0]
    return {number: " ".join(words.split()) for number, words in _BOARD.findall(section)}


def student_edition(notebook: nbformat.NotebookNode) -> nbformat.NotebookNode:
    """A chapter in MyST without solutions and answers, nor what is said of them.

    Cells that need what the student has to write may fail: they have the tag at which Jupyter goes on. Checks that need
    it are out, as part of the solution.
    """
    cells, solved = [], False
    defined, lacking = set(), set()  # names
    for cell in notebook.cells:
        tags = cell.metadata.get("tags", [])
        if cell.cell_type == "markdown":
            text = _OF_SOLUTION.sub("", cell.source) if solved else cell.source
            for pattern, words in _FOR_STUDENTS:
                text = pattern.sub(words, text)
            cells.append(nbformat.v4.new_markdown_cell(text, id=cell.id))
            continue
        made, used = _names(cell.source)
        if "solution" in tags:
            solved = True
            lacking |= made - defined
            cells.append(nbformat.v4.new_markdown_cell(YOUR_TURN, id=cell.id))
            continue
        if "exercise" in tags:
            lacking |= made
        elif used & lacking and "check." not in cell.source:
            lacking |= made
            if "checks" in tags:
                continue
            cell = nbformat.from_dict({**cell, "metadata": {**cell.metadata, "tags": [*tags, "raises-exception"]}})
        else:
            lacking -= made
            defined |= made
        cells.append(cell)
    return nbformat.v4.new_notebook(cells=cells, metadata=notebook.metadata)


def nbgrader_source(notebook: nbformat.NotebookNode) -> nbformat.NotebookNode:
    """A chapter in MyST as an assignment: from it, nbgrader makes what students get, and grades what they hand in.

    It is the edition for students with each solution between the marks that nbgrader cuts out, and checks that return
    points.
    """
    solutions = [cell.source for cell in notebook.cells if "solution" in cell.metadata.get("tags", [])]
    cells = []
    for cell in student_edition(notebook).cells:
        tags, checked = cell.metadata.get("tags", []), _CHECK.search(cell.source)
        if cell.source == YOUR_TURN:
            continue
        if "exercise" in tags:
            solution = solutions.pop(0)
            name, source = ast.parse(cell.source).body[0].name, solution.split("\n")
            function = next(node for node in ast.parse(solution).body if getattr(node, "name", "") == name)
            helpers = textwrap.indent("\n".join(source[: function.lineno - 1]).strip(), " " * 4)
            body = source[function.body[0].lineno - 1 : function.end_lineno]
            region = ["    ### BEGIN SOLUTION", *([helpers] if helpers else []), *body, "    ### END SOLUTION"]
            cell = _of_nbgrader(cell, "\n".join([*cell.source.split("\n")[:-1], *region]), name, solution=True)
        elif cell.cell_type == "code" and checked:
            points = check.EXERCISES[checked[1]].stars
            cell = _of_nbgrader(cell, f"{cell.source}.points", f"check_{checked[1]}", grade=True, points=points)
        cells.append(cell)
    return nbformat.v4.new_notebook(cells=cells, metadata=notebook.metadata)


def _of_nbgrader(cell: nbformat.NotebookNode, source: str, name: str, **settings: object) -> nbformat.NotebookNode:
    usual = {"schema_version": 3, "grade_id": name, "grade": False, "solution": False, "task": False}
    described = {**usual, "locked": bool(settings.get("grade")), **settings}
    return nbformat.from_dict({**cell, "source": source, "metadata": {**cell.metadata, "nbgrader": described}})


def _names(code: str) -> tuple[set[str], set[str]]:
    """The names that a cell defines, and those that it uses."""
    nodes = list(ast.walk(ast.parse(code)))
    made = {node.name for node in nodes if isinstance(node, ast.FunctionDef)}
    made |= {node.asname or node.name for node in nodes if isinstance(node, ast.alias)}
    made |= {node.id for node in nodes if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)}
    return made, {node.id for node in nodes if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load)}


def instructor_edition(notebook: nbformat.NotebookNode, notes: str) -> nbformat.NotebookNode:
    """A chapter in MyST with everything, and the notes for the board below its head."""
    board = nbformat.v4.new_markdown_cell(f"**On the board.** {notes}", id="on-the-board")
    cells = [*notebook.cells[:1], *([board] if notes else []), *notebook.cells[1:]]
    return nbformat.v4.new_notebook(cells=cells, metadata=notebook.metadata)


def without_outputs(notebook: nbformat.NotebookNode) -> nbformat.NotebookNode:
    """A plain notebook as if nothing had been run."""
    cells = [
        nbformat.from_dict({**cell, "outputs": [], "execution_count": None}) if cell.cell_type == "code" else cell
        for cell in notebook.cells
    ]
    return nbformat.v4.new_notebook(cells=cells, metadata=notebook.metadata)


def build_wheel(folder: Path, *, solutions: bool) -> Path:
    """The wheel of the package, from a copy of what it is made of: what lies in ``build`` must not get in.

    Without ``solutions``, the checkers have the expected answers, and the modules with the functions are left out.
    """
    source = folder / "source"
    shutil.copytree(ROOT / "src", source / "src", ignore=shutil.ignore_patterns("__pycache__", "*.egg-info"))
    if not solutions:
        exercises = source / "src" / "meshot_book" / "exercises"
        check.write_answers(exercises / "check" / check.ANSWERS.name)
        for module in {found.__module__ for found in check.EXERCISES.values()}:
            (exercises / f"{module.rpartition('.')[2]}.py").unlink()
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    command = [sys.executable, "-m", "pip", "wheel", "-q", "--disable-pip-version-check", "--no-deps"]
    subprocess.run([*command, "--no-build-isolation", "--wheel-dir", folder, source], check=True)
    (wheel,) = folder.glob("*.whl")
    return wheel


def write_zip(
    file: Path,
    edition: str,
    notebooks: dict[str, nbformat.NotebookNode],
    wheel: Path,
    more: Mapping[str, str | bytes] | None = None,
) -> None:
    """Write one edition, with everything that its notebooks need, and further files by their names."""
    page = jinja2.Template((ROOT / "book" / "assets" / "start_here.md").read_text(encoding="utf-8"))
    contents = {
        "student": "the chapters, without solutions and outputs",
        "instructor": "the chapters as they were run, with solutions and notes for the board",
    }
    named = {"edition": edition, "contents": contents[edition], "wheel": wheel.name, "published": PUBLISHED}
    texts = {"START_HERE.md": page.render(named) + "\n", "requirements.txt": REQUIREMENTS.format(wheel=wheel.name)}
    texts |= more or {}
    files = {"constraints.txt": ROOT / "requirements.lock", "LICENSE": ROOT / "LICENSE", wheel.name: wheel}
    for line in CHECKSUMS.read_text(encoding="utf-8").splitlines():
        name = line.split("  ", 1)[1]
        files[f"experiments/{name}"] = EXPERIMENTS / name
    with whole_file(file) as temporary, zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as into:
        for name, text in texts.items():
            into.writestr(f"{file.stem}/{name}", text)
        for name, notebook in notebooks.items():
            into.writestr(f"{file.stem}/notebooks/{name}.ipynb", nbformat.writes(notebook))
        for name, path in files.items():
            into.write(path, f"{file.stem}/{name}")


def main() -> int:
    """Write both editions from the command line; the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--into", type=Path, default=ROOT / "build" / "editions")
    into = parser.parse_args().into.resolve()
    notes = board_notes((ROOT / "book" / "teaching.md").read_text(encoding="utf-8"))
    editions: dict[str, dict[str, nbformat.NotebookNode]] = {"student": {}, "instructor": {}}
    more = {f"quizzes/{name}": content for name, content in quiz_files().items()}
    for source in sorted(CHAPTERS.glob("[0-9][0-9]_*.md")):
        told, name = retold_notebook(source), source.stem
        student = plain_notebook(student_edition(told), name, answers=False)
        editions["student"][name] = without_outputs(student)
        editions["instructor"][name] = plain_notebook(instructor_edition(told, notes.get(name[:2], "")), name)
        assignment = without_outputs(plain_notebook(nbgrader_source(told), name, answers=False))
        more[f"nbgrader/source/{name}/{name}.ipynb"] = nbformat.writes(assignment)
    for edition, notebooks in editions.items():
        file = into / f"meshes_as_measures_{edition}.zip"
        with tempfile.TemporaryDirectory() as folder:
            whole = edition == "instructor"
            write_zip(file, edition, notebooks, build_wheel(Path(folder), solutions=whole), more if whole else None)
        print(f"{file}: {file.stat().st_size / 1e6:.0f} MB")
    print("unpack one and open START_HERE.md")
    return 0


if __name__ == "__main__":
    sys.exit(main())
