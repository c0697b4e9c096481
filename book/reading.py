"""How long a chapter takes to read and to run: words, figures, lines of code, minutes, seconds.

``python book/reading.py`` prints the table of all chapters. The head of each chapter and the teaching guide show it.
"""

import re
import sys
from pathlib import Path
from typing import NamedTuple

import nbformat

from meshot_book.notebook import stated_seconds

#: Cells with one of these tags are folded behind one line.
FOLDED_TAGS = {"imports", "drawing", "table", "checks", "solution", "hide-cell", "hide-input"}
WORDS_A_MINUTE = 200
SECONDS_A_FIGURE = 15
SECONDS_A_LINE = 3
_NOT_WORDS = (
    re.compile(r"^(`{3,}|:{3,}).*$", re.M),  # fences of directives and code
    re.compile(r"^:[\w-]+:.*$", re.M),  # their options
    re.compile(r"\$\$.*?\$\$", re.S),
    re.compile(r"\]\([^)]*\)|\{[^}\n]*\}|^\([\w-]+\)=$", re.M),
)


class Reading(NamedTuple):
    """What a chapter asks of its reader."""

    words: int
    figures: int
    shown_lines: int
    shown_cells: int
    folded_cells: int
    seconds: int

    @property
    def minutes(self) -> int:
        """To read text, figures and the code that is shown, without quiz and exercises."""
        seconds = 60 * self.words / WORDS_A_MINUTE + SECONDS_A_FIGURE * self.figures + SECONDS_A_LINE * self.shown_lines
        return round(seconds / 60)

    @property
    def head(self) -> str:
        """One line for the head of a chapter."""
        ran = f" The code ran in {self.seconds} s." if self.seconds else ""
        return f"About {self.minutes} minutes to read: {self.words:,} words, {self.figures} figures and tables.{ran}"


def count_reading(notebook: nbformat.NotebookNode) -> Reading:
    """Count what a stored notebook holds, without its exercises: they begin at the heading that says so."""
    words = figures = lines = shown = folded = seconds = 0
    exercises = False
    for cell in notebook.cells:
        exercises = exercises or (
            cell.cell_type == "markdown" and bool(re.search(r"^## .*Exercises", cell.source, re.M))
        )
        if cell.cell_type == "markdown":
            words += 0 if exercises else count_words(cell.source)
            continue
        texts = [output.get("text", "") or output.get("data", {}).get("text/plain", "") for output in cell.outputs]
        seconds += sum(map(stated_seconds, texts))
        hidden = bool(FOLDED_TAGS & set(cell.metadata.get("tags", [])))
        shown, folded = shown + (not hidden), folded + hidden
        if not exercises:
            figures += any(
                "image/png" in out.get("data", {}) or "text/html" in out.get("data", {}) for out in cell.outputs
            )
            lines += 0 if hidden else sum(bool(line.strip()) for line in cell.source.splitlines())
    return Reading(words, figures, lines, shown, folded, seconds)


def count_words(text: str) -> int:
    """Words of Markdown as a reader meets them; a formula within a sentence counts as one."""
    for pattern in _NOT_WORDS:
        text = pattern.sub(" ", text)
    text = re.sub(r"\$[^$]+\$", " formula ", text)
    return len(re.findall(r"\w[\w'’.,-]*", text))


def read_chapters(folder: Path) -> dict[str, Reading]:
    """The stored chapters of a folder, by name."""
    return {
        path.stem: count_reading(nbformat.read(path, as_version=4))
        for path in sorted(folder.glob("[0-9][0-9]_*.ipynb"))
    }


def reading_table(readings: dict[str, Reading]) -> str:
    """A table in Markdown, a row for each chapter."""
    lines = [
        "| chapter | words | figures and tables | minutes | cells shown | cells folded | seconds to run |",
        "|---|--:|--:|--:|--:|--:|--:|",
    ]
    for name, one in readings.items():
        numbers = (one.words, one.figures, one.minutes, one.shown_cells, one.folded_cells, one.seconds or "–")
        lines.append(f"| {name[:2]} | " + " | ".join(map(str, numbers)) + " |")
    return "\n".join(lines)


if __name__ == "__main__":
    print(reading_table(read_chapters(Path(__file__).resolve().parent.parent / "notebooks")))
    sys.exit()
