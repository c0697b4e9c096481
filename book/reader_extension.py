"""How the book reads a chapter: cells that a reader need not see are folded, and its head says how long it takes.

The directive ``reading-table`` shows the same numbers of all chapters.
"""

import re
from pathlib import Path

import nbformat
from docutils import nodes
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from reading import count_reading, read_chapters, reading_table

#: Tag of a cell -> what MyST-NB folds, and the line that stands in its place.
FOLDED = {
    "imports": ("hide-input", "code: imports"),
    "drawing": ("hide-input", "code: drawing"),
    "table": ("hide-input", "code: table"),
    "checks": ("hide-input", "code: checks"),
    "solution": ("hide-cell", "the solution"),
}


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


class ReadingTable(SphinxDirective):
    """Words, minutes and cells of every chapter."""

    def run(self) -> list[nodes.Node]:
        """The table, read from the notebooks that are rendered."""
        rows = reading_table(read_chapters(Path(self.env.srcdir))).splitlines()
        holder = nodes.Element()
        self.state.nested_parse(StringList(rows, source=self.env.docname), self.content_offset, holder)
        return holder.children


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive; ``nb_custom_formats`` names the reader."""
    app.add_directive("reading-table", ReadingTable)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
