"""What the pages have in common that notebooks and the book show as they are: opening, marks, name, still picture."""

import base64
import hashlib
import io
from collections.abc import Mapping

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

#: How the script of a page begins. Shown twice, a page is brought to life once.
OPENING = """(function () {
  "use strict";
  const data = @DATA@;
  const root = document.getElementById("@ID@");
  if (!root || root.dataset.ready) { return; }
  root.dataset.ready = "yes";
"""


def filled(page: str, marks: Mapping[str, str]) -> str:
    """The page with every mark replaced, in the order given: what comes in early may hold later marks."""
    for mark, text in marks.items():
        page = page.replace(mark, text)
    return page


def identity(kind: str, text: str) -> str:
    """A name for the page's outermost element that depends on what it holds, and on nothing else."""
    return f"{kind}-" + hashlib.sha256(text.encode()).hexdigest()[:12]


def still_of(figure: Figure) -> str:
    """The figure, which is closed, as a PNG in base64."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=80)
    plt.close(figure)
    return base64.b64encode(buffer.getvalue()).decode()
