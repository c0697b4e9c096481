"""The notebooks show every live figure, as its script is today."""

import re

import nbformat

from meshot.view.page import joined
from meshot_book.live.figure import figure_names


def stored_figures(folder):
    """Chapter, name and page of each live figure in the stored notebooks."""
    for file in sorted(folder.glob("[0-9]*.ipynb")):
        for cell in nbformat.read(file, as_version=4).cells:
            for output in cell.get("outputs", []):
                page = output.get("data", {}).get("text/html", "")
                found = re.search(r'data-figure="(\w+)"', page)
                if found:
                    yield file.stem, found[1], page


def test_notebooks_hold_every_figure_as_it_is_today(root):
    seen = set()
    for chapter, name, page in stored_figures(root / "notebooks"):
        script = joined("meshot/view/assets/wake.js", f"meshot_book/live/figures/assets/{name}.js")
        assert script in page, f"{chapter} shows an older {name}: make notebooks NAME={chapter}"
        seen.add(name)
    assert sorted(seen) == figure_names()
