"""How the book reads a chapter: cells that a reader need not see are folded behind one quiet line."""

import nbformat
from sphinx.application import Sphinx

#: Tag of a cell -> what MyST-NB folds, and the line that stands in its place.
FOLDED = {
    "imports": ("hide-input", "code: imports"),
    "drawing": ("hide-input", "code: drawing"),
    "checks": ("hide-input", "code: checks"),
    "solution": ("hide-cell", "the solution"),
}


def read_chapter(text: str) -> nbformat.NotebookNode:
    """A stored notebook with the folding that the tags of its cells ask for."""
    notebook = nbformat.reads(text, as_version=4)
    for cell in notebook.cells:
        tags = cell.metadata.get("tags", [])
        for tag in [tag for tag in tags if tag in FOLDED]:
            hidden, name = FOLDED[tag]
            cell.metadata["tags"] = [*tags, hidden]
            prompts = {"code_prompt_show": f"Show {name}", "code_prompt_hide": f"Hide {name}"}
            cell.metadata["mystnb"] = prompts | cell.metadata.get("mystnb", {})
    return notebook


def setup(app: Sphinx) -> dict[str, bool]:
    """Register nothing: ``nb_custom_formats`` names the reader."""
    return {"parallel_read_safe": True, "parallel_write_safe": True}
