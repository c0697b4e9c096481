"""Pictures of systems beside each other: paired differences with intervals, and found against printed numbers."""

import itertools
from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from meshot.view import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILLION, WIDTH

_COLOURS = (BLUE, VERMILLION, GREEN, ORANGE, PURPLE, SKY, BLACK)
_MARKERS = ("o", "s", "^", "D", "v", "P")
_SPREAD = 0.6  # of the space of a name, which its groups share


def intervals_figure(rows: Sequence[Mapping], quantities: Mapping[str, str]) -> Figure:
    """Differences with intervals: a panel for every quantity, a line for every name, a colour for every group.

    A single group gets no legend.

    Parameters
    ----------
    rows : sequence of mapping
        With ``name``, ``group``, and for every quantity a mapping with ``gap``, ``low`` and ``high``.
    quantities : mapping
        The label of the axis of every quantity, by its key in the rows.

    Raises
    ------
    ValueError
        If there is no row.
    """
    if not rows:
        raise ValueError("there is no row to draw; give at least one difference")
    names, groups = (list(dict.fromkeys(row[key] for row in rows)) for key in ("name", "group"))
    size = (WIDTH, len(quantities) * (0.8 + 0.42 * len(names)))
    figure, axes = plt.subplots(len(quantities), 1, figsize=size, layout="constrained", squeeze=False)
    shifts = dict(zip(groups, np.linspace(-0.5, 0.5, len(groups) + 2)[1:-1] * _SPREAD))
    for ax, (key, label) in zip(axes[:, 0], quantities.items()):
        ax.axvline(0.0, color=GREY, linewidth=1)
        for k, group in enumerate(groups):
            own = [row for row in rows if row["group"] == group]
            heights = np.array([names.index(row["name"]) + shifts[group] for row in own])
            gaps = np.array([row[key]["gap"] for row in own])
            ends = [np.abs(gaps - [row[key][end] for row in own]) for end in ("low", "high")]
            look = {"color": _COLOURS[k % len(_COLOURS)], "marker": _MARKERS[k % len(_MARKERS)], "markersize": 4}
            ax.errorbar(gaps, heights, xerr=ends, linestyle="none", label=group, **look)
        ax.set(xlabel=label, ylim=(len(names) - 0.5, -0.5), yticks=range(len(names)), yticklabels=names)
        ax.locator_params(axis="x", nbins=5)  # the numbers do not touch
    if len(groups) > 1:
        figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
    return figure


def printed_figure(rows: Sequence[Mapping], unit: str = "mm") -> Figure:
    """Found values over printed ones, on logarithmic axes: a colour for every name, a marker for every group.

    Parameters
    ----------
    rows : sequence of mapping
        With ``name``, ``group``, ``printed`` and ``found``; both numbers are positive.
    unit : str

    Raises
    ------
    ValueError
        If there is no row, or a number is not positive.
    """
    values = np.array([[row["printed"], row["found"]] for row in rows])
    if not len(rows) or not (values > 0).all():
        raise ValueError(f"{len(rows)} rows with values from {values.min(initial=0)}; positive numbers are needed")
    names, groups = (list(dict.fromkeys(row[key] for row in rows)) for key in ("name", "group"))
    colours, markers = dict(zip(names, itertools.cycle(_COLOURS))), dict(zip(groups, itertools.cycle(_MARKERS)))
    figure, ax = plt.subplots(figsize=(WIDTH, 6.4), layout="constrained")
    for row, (x, y) in zip(rows, values):
        ax.plot(x, y, markers[row["group"]], color=colours[row["name"]])
    ends = np.array([values.min() / 1.2, values.max() * 1.2])
    ax.plot(ends, ends, color=GREY, linestyle=":")
    for axis, scale in ((ax.xaxis, ax.set_xscale), (ax.yaxis, ax.set_yscale)):
        scale("log")
        axis.set_major_locator(LogLocator(subs=(1.0, 1.5, 2.0, 3.0, 5.0, 7.0)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_locator(NullLocator())
    ax.set(xlabel=f"printed ({unit})", ylabel=f"found ({unit})")
    keys = [ax.plot([], [], "o", color=colour, label=name)[0] for name, colour in colours.items()]
    keys += [ax.plot([], [], marker, color="0.3", label=group)[0] for group, marker in markers.items()]
    figure.legend(handles=keys, loc="outside upper center", ncols=2)
    return figure
