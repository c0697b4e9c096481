"""The directive ``shown``: what a cell of a chapter shows, on another page too.

``{shown} CHAPTER WORD`` takes the first output of the stored notebook whose text begins with the word, such as
``LiveFigure`` or ``Scene``.
"""

from pathlib import Path

import nbformat
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective


def shown_html(notebook: Path, word: str) -> str:
    """The HTML of the first output of a notebook whose text begins with a word."""
    for cell in nbformat.read(notebook, as_version=4).cells:
        for output in cell.get("outputs", []):
            data = output.get("data", {})
            if data.get("text/plain", "").startswith(word) and "text/html" in data:
                return data["text/html"]
    raise ValueError(f"no output of {notebook.name} begins with {word!r} and has HTML")


class Shown(SphinxDirective):
    """What a cell shows, once more."""

    required_arguments = 2

    def run(self) -> list[nodes.Node]:
        """The HTML in a box."""
        chapter, word = self.arguments
        notebook = Path(self.env.srcdir) / f"{chapter}.ipynb"
        self.env.note_dependency(str(notebook))
        try:
            html = shown_html(notebook, word)
        except (ValueError, OSError) as error:
            raise self.error(f"shown: {error}") from error
        box = nodes.container("", classes=["shown"])
        box += nodes.raw("", html, format="html")
        return [box]


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("shown", Shown)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
