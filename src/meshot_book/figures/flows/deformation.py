"""A surface on its way: an interactive view in which a reader moves through the time of a deformation, offline."""

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogFormatterSciNotation, NullFormatter, ScalarFormatter

from meshot.mesh import Mesh
from meshot.types import Array, Float, Tensor
from meshot.view import (
    BLACK,
    COLOUR_MAP,
    GREY,
    LOSS_COLOURS,
    LOSS_DASHES,
    WIDTH,
    Page,
    Values,
    interactive,
    legend_above,
    live_page,
)


def deformation_view(
    mesh: Mesh,
    paths: Mapping[str, Float[Tensor, "k V 3"]],
    times: Sequence[float],
    *,
    alt: str,
    values: Mapping[str, Float[Array, "k V"]] | None = None,
    beside: Mapping[str, Mesh] | None = None,
    label: str = "",
    unit: str = "mm",
    limits: tuple[float, float] | None = None,
    colour_map: str = COLOUR_MAP,
    view: str = "left",
) -> Page:
    """A surface that deforms, one deformation at a time, with a slider for the time, a button, and a still first.

    It starts at rest, with the end of the first deformation. The surface can be turned and zoomed at any time. The
    button plays about ten moments a second; two where a reader asks for reduced motion. Everything can be done by keys.
    Each moment takes about 3 bytes a face.

    Tag the cell ``nbval-ignore-output``, as for :func:`meshot.view.interactive`.

    Parameters
    ----------
    mesh : Mesh
        Whose faces are drawn.
    paths : mapping
        Name → where the vertices are at each of ``times``.
    times : sequence of float
        Rising.
    alt : str
        What is to be seen, for those who do not see it.
    values : mapping, optional
        Name → one number for each moment and vertex, coloured on one scale.
    beside : mapping, optional
        Surfaces that do not move, such as the target, to be chosen too.
    label, unit, limits, colour_map, view
        As :func:`meshot.view.interactive`.

    Raises
    ------
    ValueError
        If there is no path, a path or its values do not have one row for each time, the times do not rise, a name
        occurs twice, or as :func:`meshot.view.interactive`.
    RuntimeError
        If there is no OpenGL here to draw the still.
    """
    beside = dict(beside or {})
    _require_frames(mesh, paths, times, values or {}, beside)
    last = len(times) - 1
    meshes, shades, choices = {}, {}, []
    for name, places in paths.items():
        # The end comes first: what comes first is the still. What is stored twice takes no room.
        order = [last, *range(last)]
        start = len(meshes)
        for k in order:
            meshes[f"{name}, {times[k]:.4g}"] = mesh.with_vertices(places[k])
            if values and name in values:
                shades[f"{name}, {times[k]:.4g}"] = values[name][k]
        choices.append({"name": name, "items": [start + order.index(k) for k in range(len(times))]})
    for name, other in beside.items():
        choices.append({"name": name, "items": [len(meshes)]})
        meshes[name] = other
    options = {"label": label, "unit": unit, "limits": limits, "colour_map": colour_map, "view": view}
    scene = interactive(meshes, shades or None, alt=alt, **options)
    return live_page(
        "meshot_book/figures/assets/deformation",
        {"times": [float(t) for t in times], "choices": choices},
        f"Deformation({', '.join([*paths, *beside])}; {len(times)} frames; run the cell to see it move)",
        alt=alt,
        last=last,
        scene=scene.html,
    )


def _require_frames(mesh: Mesh, paths: Mapping, times: Sequence[float], values: Mapping, beside: Mapping) -> None:
    if not paths:
        raise ValueError("paths is empty; at least one deformation is needed")
    if len(times) < 2 or not (np.diff(times) > 0).all():
        raise ValueError(f"times are {list(times)}; two or more rising numbers are needed")
    twice = set(paths) & set(beside)
    if twice:
        raise ValueError(
            f"{', '.join(sorted(twice))} is the name of a deformation and of a surface beside it; rename one"
        )
    wanted = (len(times), len(mesh.vertices))
    for name, places in paths.items():
        if tuple(places.shape) != (*wanted, 3):
            raise ValueError(
                f"the path {name!r} has shape {tuple(places.shape)}; {(*wanted, 3)} is needed, a row a time"
            )
    for name, numbers in values.items():
        if name not in paths:
            raise ValueError(f"values are named {name!r}, which is none of the paths: {', '.join(paths)}")
        if tuple(numbers.shape) != wanted:
            raise ValueError(f"values {name!r} has shape {tuple(numbers.shape)}; {wanted} is needed, a row a time")


# Charts of deformed meshes: how even the triangles are, how near they come, in how long, and one over the other.

#: An arm is named "loss, encoding": the loss has the colour, the encoding the dashes and the marker.
ENCODING_LINES = {
    "varifold": {"linestyle": "-", "marker": "o"},
    "samples": {"linestyle": "--", "marker": "s"},
    "exact measure": {"linestyle": ":", "marker": "^"},
}


def arm_line(name: str) -> dict[str, str]:
    """Colour, dashes and marker of an arm "loss, encoding", as keyword arguments; black and solid where unknown."""
    loss, _, encoding = name.partition(", ")
    return {"color": LOSS_COLOURS.get(loss, BLACK)} | ENCODING_LINES.get(encoding, {"linestyle": "-", "marker": "D"})


def histogram_figure(panels: Mapping[str, Mapping[str, Values]], n_bins: int = 40) -> Figure:
    """How often which value occurs: a panel under another, an outline for every name, of equal area.

    Parameters
    ----------
    panels : mapping
        Label of the horizontal axis (with its unit) → name → values. Losses keep their colours; the start is black, the
        target grey and filled.
    n_bins : int
        The same for all names, up to the 99.5 % quantile of all values; larger ones fall into the last.
    """
    figure, axes = plt.subplots(len(panels), 1, figsize=(WIDTH, 2.6 * len(panels)), layout="constrained", squeeze=False)
    for ax, (label, values) in zip(axes[:, 0], panels.items()):
        every = np.concatenate([np.asarray(v, dtype=float) for v in values.values()])
        edges = np.linspace(every.min(), np.quantile(every, 0.995), n_bins + 1)
        for name, numbers in values.items():
            style = {"histtype": "step", "linewidth": 2, "color": LOSS_COLOURS.get(name, BLACK)}
            style |= {"linestyle": LOSS_DASHES.get(name, ":")}
            if name == "target":
                style |= {"histtype": "stepfilled", "color": GREY, "alpha": 0.45, "linestyle": "-"}
            ax.hist(np.clip(numbers, edges[0], edges[-1]), bins=edges, density=True, label=name, **style)
        ax.set(xlabel=label, ylabel="density")
        ax.set_yticks([])
    legend_above(figure, axes[0, 0])
    return figure


def arms_figure(
    panels: Mapping[str, Mapping[str, tuple[Sequence[float], Sequence[float]]]],
    y_label: str,
    marks: Mapping[str, float] | None = None,
    y_scale: str = "log",
) -> Figure:
    """One quantity over several clocks: a panel beside another, a line for every arm.

    Parameters
    ----------
    panels : mapping
        Label of the horizontal axis (with its unit) → name of the arm → (x, y).
    y_label : str
        With its unit.
    marks : mapping, optional
        Heights to mark by a thin line, by what they are.
    y_scale : str
        "log" or "linear".
    """
    options = {"figsize": (WIDTH, 5.2), "layout": "constrained", "sharey": True, "squeeze": False}
    figure, axes = plt.subplots(1, len(panels), **options)
    for ax, (label, lines) in zip(axes[0], panels.items()):
        for name, (x, y) in lines.items():
            ax.plot(x, y, label=_short(name), markersize=4, linewidth=1.6, **arm_line(name))
        for name, height in (marks or {}).items():
            ax.axhline(height, color=GREY, linewidth=1.2, linestyle=(0, (1, 2)), label=name)
        ax.set(xlabel=label, yscale=y_scale)
    axes[0, 0].set_ylabel(y_label)
    if y_scale == "log":
        _plain_ticks(axes[0, 0])
    legend_above(figure, axes[0, 0])
    return figure


def _plain_ticks(ax: plt.Axes) -> None:
    """Numbers at 1, 2 and 5 of every decade, as long as there are few decades."""
    low, high = ax.get_ylim()
    if high / low > 200:
        ax.yaxis.set_major_formatter(LogFormatterSciNotation())
        return
    steps = [m * 10.0**k for k in range(-4, 4) for m in (1, 2, 5)]
    ax.set_yticks([s for s in steps if low <= s <= high])
    ax.yaxis.set_major_formatter(ScalarFormatter())
    ax.yaxis.set_minor_formatter(NullFormatter())


def trade_off_figure(
    panels: Mapping[str, Mapping[str, tuple[Sequence[float], Sequence[float]]]],
    x_label: str,
    marks: Mapping[str, float] | None = None,
) -> Figure:
    """One quantity against others: a panel under another, a marker for every run, runs of an arm alike.

    Parameters
    ----------
    panels : mapping
        Label of the vertical axis (with its unit) → name of the arm → (x, y) of its runs.
    x_label : str
        With its unit.
    marks : mapping, optional
        Label of the vertical axis → a height to mark by a thin line: what the target itself has.
    """
    options = {"figsize": (WIDTH, 3.0 * len(panels) + 0.8), "layout": "constrained", "sharex": True, "squeeze": False}
    figure, axes = plt.subplots(len(panels), 1, **options)
    for ax, (label, runs) in zip(axes[:, 0], panels.items()):
        for name, (x, y) in runs.items():
            style = arm_line(name)
            ax.scatter(x, y, color=style["color"], marker=style["marker"], s=34, label=_short(name), alpha=0.8)
        if marks and label in marks:
            ax.axhline(marks[label], color=GREY, linewidth=1.2, linestyle=(0, (1, 2)), label="the target itself")
        ax.set_ylabel(label)
    axes[-1, 0].set_xlabel(x_label)
    legend_above(figure, axes[0, 0])
    return figure


def _short(name: str) -> str:
    """The name of an arm as a legend shows it, where five names stand in two columns."""
    return name.replace("sliced Wasserstein", "sliced")
