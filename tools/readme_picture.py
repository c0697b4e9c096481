"""Copy the process figure from the stored chapter 01 for the README, so that it is a computed picture."""

import base64
from pathlib import Path

import nbformat

from meshot.files import whole_file

ROOT = Path(__file__).resolve().parent.parent
CHAPTER = ROOT / "notebooks" / "01_circle_to_polygon.ipynb"
PICTURE = ROOT / "book" / "_static" / "circle_to_polygon.png"


def process_figure() -> bytes:
    """The first picture of a cell with a process figure, as PNG."""
    cells = nbformat.read(CHAPTER, as_version=4).cells
    cell = next(c for c in cells if c.cell_type == "code" and "process_figure(" in c.source)
    return base64.b64decode(next(o.data["image/png"] for o in cell.outputs if "image/png" in o.get("data", {})))


if __name__ == "__main__":
    with whole_file(PICTURE) as temporary:
        temporary.write_bytes(process_figure())
