"""How a system works, as one drawing: rows of boxes from the scan to a surface, with the number of learned weights."""

import dataclasses
from collections.abc import Sequence
from typing import Literal

import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from meshot.view import BLUE, GREY, ORANGE, WIDTH

#: The look of each kind of step: its border, its dashes, and the width of its border.
_LOOKS = {"data": (GREY, "-", 1.2), "learned": (BLUE, "-", 3.5), "fixed": (ORANGE, "--", 1.8)}
_ROW, _BOX, _LEGEND = 1.0, 0.76, 0.75  # inches


@dataclasses.dataclass(frozen=True)
class SystemStep:
    """One box of the drawing.

    Parameters
    ----------
    kind : str
        "data", "learned" or "fixed".
    lines : tuple of str
        What the box says, at most three lines.
    n_weights : int
        Number of learned weights. Zero if nothing is learned.

    Raises
    ------
    ValueError
        If the kind is unknown, or a step that is not learned has weights.
    """

    kind: Literal["data", "learned", "fixed"]
    lines: tuple[str, ...]
    n_weights: int = 0

    def __post_init__(self):
        if self.kind not in _LOOKS:
            raise ValueError(f"kind is {self.kind!r}; one of {', '.join(_LOOKS)} is needed")
        if (self.n_weights > 0) != (self.kind == "learned"):
            raise ValueError(f"a step of kind {self.kind} has {self.n_weights} weights; only learned steps have some")

    @property
    def text(self) -> str:
        """The lines of the box. The last one states the weights, if there are any."""
        number = f"{self.n_weights:,} weight{'s' * (self.n_weights > 1)}".replace(",", " ")
        return "\n".join([*self.lines, *[f"learns {number}"] * bool(self.n_weights)])


def system_figure(rows: Sequence[Sequence[SystemStep]]) -> Figure:
    """Rows of one or two boxes, from top to bottom. Every box of a row leads to every box of the next row.

    The kinds differ in the line of their border, and a legend says which is which.

    Parameters
    ----------
    rows : sequence of sequences of SystemStep

    Raises
    ------
    ValueError
        If a row has no box or more than two.
    """
    wrong = [len(row) for row in rows if len(row) not in (1, 2)]
    if wrong or not rows:
        raise ValueError(f"{len(rows)} rows came, with {wrong} boxes in some; rows of one or two boxes are needed")
    height = _ROW * len(rows) + _LEGEND
    figure, ax = plt.subplots(figsize=(WIDTH, height), layout="constrained")
    ax.set(xlim=(0, WIDTH), ylim=(0, height))
    ax.set_axis_off()
    above: list[float] = []
    for number, row in enumerate(rows):
        top = height - _ROW * number - 0.05
        middles = [WIDTH * (2 * k + 1) / (2 * len(row)) for k in range(len(row))]
        for step, middle in zip(row, middles):
            _draw_box(ax, step, middle, top, WIDTH / len(row) - 0.3)
            for start in above:
                _draw_arrow(ax, (start, top + _ROW - _BOX), (middle, top), len(above) > len(row))
        above = middles
    _draw_legend(ax)
    return figure


def _draw_box(ax: Axes, step: SystemStep, middle: float, top: float, width: float) -> None:
    colour, dashes, line = _LOOKS[step.kind]
    look = {"boxstyle": "round,pad=0", "edgecolor": colour, "facecolor": "white", "linestyle": dashes}
    ax.add_patch(FancyBboxPatch((middle - width / 2, top - _BOX), width, _BOX, linewidth=line, **look))
    ax.text(middle, top - _BOX / 2, step.text, ha="center", va="center", linespacing=1.05)


def _draw_arrow(ax: Axes, start: tuple[float, float], end: tuple[float, float], meeting: bool) -> None:
    """An arrow from the bottom of a box to the top of another; arrows that meet end a little apart."""
    x = end[0] + (0.12 * (start[0] - end[0]) if meeting else 0.0)
    arrow = {"arrowstyle": "-|>", "color": "0.3", "linewidth": 1.4, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", (x, end[1]), start, arrowprops=arrow)


def _draw_legend(ax: Axes) -> None:
    for k, (kind, (colour, dashes, line)) in enumerate(_LOOKS.items()):
        x = WIDTH * k / len(_LOOKS) + 0.15
        ax.plot([x, x + 0.45], [0.25, 0.25], color=colour, linestyle=dashes, linewidth=line)
        ax.text(x + 0.55, 0.25, kind, va="center")
