"""Copy pictures of stored chapters for the README, so that they are computed."""

import base64
from pathlib import Path

import nbformat

from meshot.files import whole_file

ROOT = Path(__file__).resolve().parent.parent
#: By the file of the picture: the chapter, and what the cell calls that shows it first.
PICTURES = {
    "circle_to_polygon.png": ("01_circle_to_polygon", "process_figure("),
    "person.png": ("23_a_real_scan", "kept_slices_figure("),
}


def picture_of(chapter: str, call: str) -> bytes:
    """The first picture of a cell with a call, as PNG."""
    cells = nbformat.read(ROOT / "notebooks" / f"{chapter}.ipynb", as_version=4).cells
    outputs = (out for c in cells if c.cell_type == "code" and call in c.source for out in c.outputs)
    return base64.b64decode(next(out.data["image/png"] for out in outputs if "image/png" in out.get("data", {})))


if __name__ == "__main__":
    for name, (chapter, call) in PICTURES.items():
        with whole_file(ROOT / "book" / "_static" / name) as temporary:
            temporary.write_bytes(picture_of(chapter, call))
