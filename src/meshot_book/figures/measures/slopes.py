"""Errors on logarithmic axes, with the lines that were fitted to them."""

import itertools
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from meshot.view import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILLION

COLOURS = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY, BLACK)
MARKERS = "os^Dv<>"
DASHES = ("--", ":", "-.")
Values = Sequence[float] | np.ndarray
Curve = tuple[Values, Values, tuple[float, float, float] | None]


def draw_slopes(ax: Axes, curves: Mapping[str, Curve]) -> None:
    """Draw every curve as points and its fitted power law as a line; the legend gives exponent and interval.

    Parameters
    ----------
    ax : Axes
        Both axes become logarithmic; the labels are the caller's.
    curves : mapping
        Name → (x, y, (slope, low, high)), as :func:`meshot_book.statistics.fitted_slope` returns the last; None in its
        place draws a grey line without points, for a bound or a closed form.
    """
    ax.set(xscale="log", yscale="log")
    looks, dashes = zip(itertools.cycle(COLOURS), itertools.cycle(MARKERS)), itertools.cycle(DASHES)
    for name, (x, y, fit) in curves.items():
        x, y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
        if fit is None:
            ax.plot(x, y, linestyle=next(dashes), color=GREY, linewidth=2, label=name, zorder=1)
            continue
        colour, marker = next(looks)
        slope, low, high = fit
        line = np.exp(np.median(np.log(y) - slope * np.log(x))) * x**slope
        ax.plot(x, line, color=colour, linewidth=1.4, zorder=2)
        places = 2 if high - low >= 0.02 else 3
        text = f"{name}: {slope:.{places}f} [{low:.{places}f}, {high:.{places}f}]".replace("-", "−")
        ax.plot(x, y, marker, color=colour, markersize=6, zorder=3, label=text)
    _label_short(ax.yaxis, *ax.get_ylim())


def _label_short(axis: Axis, low: float, high: float) -> None:
    """Labels between the decades, in plain numbers, where an axis spans little more than one."""
    if high / low < 30:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())
