"""Errors on logarithmic axes, with the lines that were fitted to them."""

import itertools
from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator

from meshot.view import BLACK, BLUE, GREEN, GREY, LOSS_COLOURS, ORANGE, PURPLE, SKY, SYSTEM_COLOURS, VERMILLION, WIDTH

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
        Name → (x, y, (slope, low, high)), as ``meshot_book.statistics.fitted_slope`` returns the last; None in its
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


# Time and memory of losses over the number of supports.

#: Family of a peer (the first word of its name) → colour; members differ by marker and dashes.
FAMILY_COLOURS = {
    "sliced": LOSS_COLOURS["sliced Wasserstein"],
    "Chamfer": LOSS_COLOURS["Chamfer"],
    "Sinkhorn": LOSS_COLOURS["Sinkhorn"],
    "np.argsort": GREY,
}
_MARKS = ("o", "s", "^", "D", "v", "P")
_DASHES = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)), (0, (1, 3)))


def cost_figure(rows: Sequence[Mapping], quantity: str, label: str, factor: float = 1.0) -> Figure:
    """One panel for each dimension: a quantity over the supports on each side, both axes logarithmic.

    Parameters
    ----------
    rows : sequence of mappings
        With "peer", "d", "m" and ``quantity``, as the benchmark writes them.
    quantity : str
        "seconds" or "bytes".
    label : str
        Of the vertical axis, with its unit.
    factor : float
        By which the quantity is multiplied, to come in that unit.

    Raises
    ------
    ValueError
        If no row has the quantity.
    """
    shown = [row for row in rows if row.get(quantity)]
    if not shown:
        raise ValueError(f"no row has {quantity!r}; rows of the benchmark are needed, with peer, d, m and the quantity")
    dimensions = sorted({row["d"] for row in shown})
    names = list(dict.fromkeys(row["peer"] for row in shown))
    looks = _looks(names)
    size = (WIDTH, 4.2 * len(dimensions))
    figure, axes = plt.subplots(len(dimensions), 1, figsize=size, layout="constrained", sharex=True, squeeze=False)
    for ax, d in zip(axes[:, 0], dimensions):
        for name in names:
            own = sorted((row["m"], factor * row[quantity]) for row in shown if row["d"] == d and row["peer"] == name)
            if own:
                ax.plot(*np.array(own).T, **looks[name], label=name, markersize=6, linewidth=1.8)
        space = "points" if d == 3 else "points with normals"
        ax.set(xscale="log", yscale="log", ylabel=label, title=f"{space}, $d = {d}$")
    axes[-1, 0].set_xlabel("supports (faces, if continuous) on each side")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
    return figure


def _looks(names: Sequence[str]) -> dict[str, dict]:
    """Colour by family, marker and dashes by member."""
    members: dict[str, int] = {}
    looks = {}
    for name in names:
        family = name.split(",")[0].split(" ")[0]
        k = members.get(family, 0)
        members[family] = k + 1
        looks[name] = {
            "color": FAMILY_COLOURS.get(family, BLACK),
            "marker": _MARKS[k % len(_MARKS)],
            "linestyle": _DASHES[k % len(_DASHES)],
        }
    return looks


# What the number of steps does to a flow: how far it is from the exact one, and from where it should lead.


def step_errors_figure(
    n_steps: Sequence[int],
    from_exact: Mapping[str, Sequence[float]],
    from_target: Sequence[float],
    marks: Mapping[str, float] | None = None,
) -> Figure:
    """Above, on logarithmic axes, the distance from the exact flow; below, the distance from the target.

    Parameters
    ----------
    n_steps : sequence of int
    from_exact : mapping
        Name → for each number of steps how far vertices are from where the exact flow takes them, in mm.
    from_target : sequence of float
        ASSD for each number of steps, in mm.
    marks : mapping, optional
        Heights to mark in the lower panel by a thin line, by what they are.

    Raises
    ------
    ValueError
        If there are not as many values as numbers of steps.
    """
    for name, values in (*from_exact.items(), ("from_target", from_target)):
        if len(values) != len(n_steps):
            raise ValueError(f"{name} has {len(values)} values for {len(n_steps)} numbers of steps; one each is needed")
    figure, (upper, lower) = plt.subplots(2, 1, figsize=(WIDTH, 6.4), layout="constrained", sharex=True)
    for (name, values), colour, marker in zip(from_exact.items(), (BLUE, VERMILLION, ORANGE), "os^", strict=False):
        upper.loglog(n_steps, values, marker + "-", color=colour, label=name)
    upper.set(ylabel="from the exact flow (mm)")
    upper.legend()
    lower.semilogx(n_steps, from_target, "o-", color=BLUE, label="after the flow")
    for (name, height), dashes in zip((marks or {}).items(), ("--", ":", "-."), strict=False):
        lower.axhline(height, color=GREY, linestyle=dashes, linewidth=2, label=name)
    lower.set(xlabel="steps", ylabel="ASSD from the target (mm)", ylim=(0, None))
    lower.legend()
    for ax in (upper, lower):
        ax.set_xticks(list(n_steps))
        ax.xaxis.set_minor_locator(NullLocator())
        ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    return figure


# Pictures of systems beside each other: paired differences with intervals, and found against printed numbers.

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
    colours = dict(zip(names, itertools.cycle(_COLOURS))) | {n: SYSTEM_COLOURS[n] for n in names if n in SYSTEM_COLOURS}
    markers = dict(zip(groups, itertools.cycle(_MARKERS)))
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
