"""Time and memory of losses over the number of supports, with a name at the end of every line."""

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from meshot.view.style import BLACK, GREY, LOSS_COLOURS, WIDTH

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
    size = (WIDTH * 1.2, 4.6 * len(dimensions))
    figure, axes = plt.subplots(len(dimensions), 1, figsize=size, layout="constrained", sharex=True, squeeze=False)
    for ax, d in zip(axes[:, 0], dimensions):
        lines = {}
        for name in names:
            own = sorted((row["m"], factor * row[quantity]) for row in shown if row["d"] == d and row["peer"] == name)
            if own:
                lines[name] = np.array(own).T
                ax.plot(*lines[name], **looks[name], markersize=5, linewidth=1.6)
        space = "points" if d == 3 else "points with normals"
        ax.set(xscale="log", yscale="log", ylabel=label, title=f"{space}, $d = {d}$")
        _name_ends(ax, lines, looks)
    axes[-1, 0].set_xlabel("supports (faces, if continuous) on each side")
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


def _name_ends(ax: Axes, lines: Mapping[str, np.ndarray], looks: Mapping[str, dict], gap: float = 0.065) -> None:
    """Names beside the panel, at the heights of the lines' ends, pushed apart where they would touch."""
    ax.figure.canvas.draw_idle()
    to_panel = ax.transData.transform, ax.transAxes.inverted().transform
    ends = {name: to_panel[1](to_panel[0]((x[-1], y[-1]))) for name, (x, y) in lines.items()}
    order = sorted(ends, key=lambda name: ends[name][1])
    heights = [float(ends[name][1]) for name in order]
    for k in range(1, len(heights)):
        heights[k] = max(heights[k], heights[k - 1] + gap)
    over = max(0.0, heights[-1] - 1.0)
    heights = [height - over for height in heights]
    for k in range(len(heights) - 2, -1, -1):
        heights[k] = min(heights[k], heights[k + 1] - gap)
    for name, height in zip(order, heights):
        ax.annotate(
            name,
            xy=ends[name],
            xycoords="axes fraction",
            xytext=(1.04, height),
            textcoords="axes fraction",
            fontsize=12,
            va="center",
            color=looks[name]["color"],
            arrowprops={
                "arrowstyle": "-",
                "relpos": (0, 0.5),
                "color": looks[name]["color"],
                "linewidth": 0.5,
                "alpha": 0.6,
            },
            annotation_clip=False,
        )
