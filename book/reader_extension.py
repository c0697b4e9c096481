"""How the book reads a chapter: cells that a reader need not see are folded, and its head says how long it takes.

The directive ``reading-table`` shows the same numbers of all chapters.
"""

import re
from pathlib import Path
from typing import NamedTuple

import nbformat
from docutils import nodes
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from meshot_book.notebook import stated_seconds

#: Tag of a cell -> what MyST-NB folds, and the line that stands in its place.
FOLDED = {
    "imports": ("hide-input", "code: imports"),
    "drawing": ("hide-input", "code: drawing"),
    "table": ("hide-input", "code: table"),
    "checks": ("hide-input", "code: checks"),
    "provenance": ("hide-cell", "the source of these results"),
    "solution": ("hide-cell", "the solution"),
}
#: Adults read non-fiction silently at 238 words a minute (a mean over 190 studies: Brysbaert 2019). Text with symbols
#: and a second language are slower. The other rates are assumptions, which the teaching guide states.
WORDS_A_MINUTE = 200
SECONDS_A_FIGURE = 15
SECONDS_A_ROW = 3
SECONDS_A_FORMULA = 15
SECONDS_A_LINE = 3
#: For an exercise, by its stars.
MINUTES = {1: 5, 2: 10, 3: 20}
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
    rows: int
    formulas: int
    exercises: int
    shown_lines: int
    seconds: int

    @property
    def minutes(self) -> int:
        """To read text, figures, tables, formulas and the code that is shown, without quiz and exercises."""
        seconds = SECONDS_A_FIGURE * self.figures + SECONDS_A_ROW * self.rows + SECONDS_A_FORMULA * self.formulas
        return round(self.words / WORDS_A_MINUTE + (seconds + SECONDS_A_LINE * self.shown_lines) / 60)

    @property
    def head(self) -> str:
        """One line for the head of a chapter."""
        ran = f" The code ran in {self.seconds} s." if self.seconds else ""
        more = f", and {self.exercises} for the exercises" if self.exercises else ""
        return (
            f"About {self.minutes} minutes to read{more}: {self.words:,} words, {self.figures} figures and tables.{ran}"
        )


def count_reading(notebook: nbformat.NotebookNode) -> Reading:
    """Count what a stored notebook holds. The exercises begin at the heading that says so, and are timed by stars."""
    words = figures = rows = formulas = minutes = lines = seconds = 0
    exercises = False
    for cell in notebook.cells:
        exercises = exercises or (
            cell.cell_type == "markdown" and bool(re.search(r"^## .*Exercises", cell.source, re.M))
        )
        if cell.cell_type == "markdown":
            if exercises:
                minutes += sum(MINUTES[len(stars)] for stars in re.findall(r"^### .*?(★+)", cell.source, re.M))
                continue
            words += count_words(cell.source)
            rows += len(re.findall(r"^\|", cell.source, re.M))
            formulas += len(re.findall(r"\$\$.*?\$\$", cell.source, re.S))
            continue
        texts = [output.get("text", "") or output.get("data", {}).get("text/plain", "") for output in cell.outputs]
        seconds += sum(map(stated_seconds, texts))
        hidden = bool({*FOLDED, "hide-cell", "hide-input"} & set(cell.metadata.get("tags", [])))
        if not exercises:
            figures += any(
                "image/png" in out.get("data", {}) or "text/html" in out.get("data", {}) for out in cell.outputs
            )
            rows += sum(out.get("data", {}).get("text/html", "").count("<tr") for out in cell.outputs)
            lines += 0 if hidden else sum(bool(line.strip()) for line in cell.source.splitlines())
    return Reading(words, figures, rows, formulas, minutes, lines, seconds)


def count_words(text: str) -> int:
    """Words of Markdown as a reader meets them; a formula within a sentence counts as one."""
    for pattern in _NOT_WORDS:
        text = pattern.sub(" ", text)
    text = re.sub(r"\$[^$]+\$", " formula ", text)
    return len(re.findall(r"\w[\w'’.,-]*", text))


def read_chapter(text: str) -> nbformat.NotebookNode:
    """A stored notebook with the folding that the tags of its cells ask for, and its reading time below the title."""
    notebook = nbformat.reads(text, as_version=4)
    first = notebook.cells[0]
    says = f"[{count_reading(notebook).head}]{{.reading-time}}"
    first["source"] = re.sub(r"\A(# .*)$", lambda title: f"{title[1]}\n\n{says}\n", first.source, count=1, flags=re.M)
    for cell in notebook.cells:
        tags = cell.metadata.get("tags", [])
        for tag in [tag for tag in tags if tag in FOLDED]:
            hidden, name = FOLDED[tag]
            cell.metadata["tags"] = [*tags, hidden]
            prompts = {"code_prompt_show": f"Show {name}", "code_prompt_hide": f"Hide {name}"}
            cell.metadata["mystnb"] = prompts | cell.metadata.get("mystnb", {})
    return notebook


def read_chapters(folder: Path) -> dict[str, Reading]:
    """The stored chapters of a folder, by their two digits."""
    paths = sorted(folder.glob("[0-9][0-9]_*.ipynb"))
    return {path.stem[:2]: count_reading(nbformat.read(path, as_version=4)) for path in paths}


class ReadingTable(SphinxDirective):
    """Words, minutes and seconds of every chapter."""

    def run(self) -> list[nodes.Node]:
        """The table, read from the notebooks that are rendered."""
        rows = [
            "| chapter | words | figures and tables | minutes to read | minutes of exercises | seconds to run |",
            "|---|--:|--:|--:|--:|--:|",
        ]
        for number, one in read_chapters(Path(self.env.srcdir)).items():
            values = (one.words, one.figures, one.minutes, one.exercises, one.seconds or "–")
            rows.append(f"| {number} | " + " | ".join(map(str, values)) + " |")
        holder = nodes.Element()
        self.state.nested_parse(StringList(rows, source=self.env.docname), self.content_offset, holder)
        return holder.children


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive; ``nb_custom_formats`` names the reader."""
    app.add_directive("reading-table", ReadingTable)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
