"""Two editions of the notebooks from one source: ``python book/editions.py [--into FOLDER]``.

``student``     solutions, answers and quiz explanations out; nothing was run
``instructor``  everything in, with the notes for the board from the teaching guide at the head of each chapter
"""

import argparse
import re
import sys
from pathlib import Path

import nbformat

from meshot.files import whole_file

ROOT = Path(__file__).resolve().parent.parent
YOUR_TURN = "*The solution is in the instructor edition.*"
_ANSWERS = re.compile(r"^(:{3,})\{dropdown\} Answers?\n.*?^\1$\n?", re.M | re.S)
_BOARD = re.compile(r"^- \*\*(\d\d)\*\*: (.*?)(?=^- \*\*\d\d\*\*|\Z|^#)", re.M | re.S)


def board_notes(guide: str) -> dict[str, str]:
    """The notes for the board of each chapter, by its two digits."""
    _, found, rest = guide.partition("## On the board")
    if not found:
        raise ValueError("the teaching guide has no section 'On the board'")
    section = rest.split("\n## ")[0]
    return {number: " ".join(words.split()) for number, words in _BOARD.findall(section)}


def student_edition(notebook: nbformat.NotebookNode) -> nbformat.NotebookNode:
    """A chapter without solutions, answers and outputs."""
    cells = []
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            cells.append(nbformat.v4.new_markdown_cell(_ANSWERS.sub(f"{YOUR_TURN}\n", cell.source), id=cell.id))
        elif "solution" in cell.metadata.get("tags", []):
            cells.append(nbformat.v4.new_markdown_cell(YOUR_TURN, id=cell.id))
        else:
            cells.append(nbformat.v4.new_code_cell(cell.source, metadata=cell.metadata, id=cell.id))
    return nbformat.v4.new_notebook(cells=cells, metadata=notebook.metadata)


def instructor_edition(notebook: nbformat.NotebookNode, notes: str) -> nbformat.NotebookNode:
    """A chapter with everything, and the notes for the board below its head."""
    board = nbformat.v4.new_markdown_cell(f"**On the board.** {notes}", id="on-the-board")
    cells = [*notebook.cells[:1], *([board] if notes else []), *notebook.cells[1:]]
    return nbformat.v4.new_notebook(cells=cells, metadata=notebook.metadata)


def main() -> int:
    """Write both editions from the command line; the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--into", type=Path, default=ROOT / "build" / "editions")
    into = parser.parse_args().into.resolve()
    notes = board_notes((ROOT / "book" / "teaching.md").read_text(encoding="utf-8"))
    for path in sorted((ROOT / "notebooks").glob("[0-9][0-9]_*.ipynb")):
        notebook = nbformat.read(path, as_version=4)
        made = {
            "student": student_edition(notebook),
            "instructor": instructor_edition(notebook, notes.get(path.stem[:2], "")),
        }
        for name, edition in made.items():
            with whole_file(into / name / path.name) as temporary:
                nbformat.write(edition, temporary)
    print(f"open {into / 'student'} and {into / 'instructor'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
