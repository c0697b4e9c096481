"""Time and memory of losses over the number of supports."""

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from meshot.view import BLACK, GREY, LOSS_COLOURS, WIDTH

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
