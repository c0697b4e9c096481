"""Pictures of points on their way to a contour: the process, the forces, the curves."""

import itertools
from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from meshot.mesh import Contour
from meshot.types import Float, Tensor
from meshot.view import BLACK, LOSS_COLOURS, TARGET, WIDTH, loss_line

Limits = tuple[float, float, float, float]
LONGEST_ARROW = 0.45


def draw_contour(ax: Axes, contour: Contour, **options: object) -> None:
    """Draw every edge of a contour into the axes, at equal scale."""
    corners = contour.vertices[contour.edges].detach().cpu().numpy()
    settings = {"color": TARGET, "linewidth": 3, "zorder": 1, "solid_capstyle": "round"} | options
    name = settings.pop("label", None)
    for number, (start, end) in enumerate(corners):
        ax.plot([start[0], end[0]], [start[1], end[1]], label=name if number == 0 else None, **settings)
    ax.set_aspect("equal")


def draw_points(ax: Axes, points: Float[Tensor, "n 2"], colour: str, **options: object) -> None:
    """Draw points into the axes, at equal scale."""
    places = points.detach().cpu().numpy()
    settings = {"s": 7, "zorder": 3, "linewidths": 0} | options
    ax.scatter(places[:, 0], places[:, 1], color=colour, **settings)
    ax.set_aspect("equal")


def process_figure(
    moments: Mapping[str, Mapping[int, Float[Tensor, "n 2"]]],
    contour: Contour,
    colours: Mapping[str, str] | None = None,
) -> Figure:
    """Where the points are after some steps: a column for every loss, a row for every moment.

    Parameters
    ----------
    moments : mapping
        Name of the loss → number of steps → points; the same steps for every loss.
    contour : Contour
        The target, in grey.
    colours : mapping, optional
        Of the points, by name; those of the style if left out.
    """
    colours = LOSS_COLOURS if colours is None else colours
    steps = list(next(iter(moments.values())))
    figure, axes = _panels(len(steps), len(moments), contour)
    for column, (name, kept) in enumerate(moments.items()):
        for row, step in enumerate(steps):
            ax = axes[row, column]
            draw_contour(ax, contour, alpha=0.45)
            draw_points(ax, kept[step], colours.get(name, BLACK))
            ax.set_title(f"{name}\n{_steps(step)}" if row == 0 else _steps(step))
    return figure


def force_figure(
    points: Mapping[str, Float[Tensor, "n 2"]],
    forces: Mapping[str, Float[Tensor, "n 2"]],
    probes: Float[Tensor, "k 2"],
    probe_forces: Mapping[str, Float[Tensor, "k 2"]],
    contour: Contour,
    every: int = 4,
) -> Figure:
    """The forces on points (coloured arrows) and where one more point would be (grey arrows), side by side.

    Arrows on points are stretched by one factor per loss, so that a weak loss can be seen and its moments compared, and
    cut where a few would cross the whole picture; a point at rest has none. Arrows on probes all have one length.

    Parameters
    ----------
    points, forces : mapping
        By title: the name of a loss, which sets the colour, a comma, and anything else.
    probes : tensor
        Test places, the same for all panels.
    probe_forces : mapping
        By title.
    contour : Contour
    every : int
        Draw the arrow of every so-manieth point only.
    """
    figure, axes = _panels((len(points) + 1) // 2, 2, contour)
    scales = _arrow_scales(forces)
    for ax, title in zip(axes.flat, points):
        draw_contour(ax, contour, alpha=0.35)
        _draw_directions(ax, probes.numpy(), probe_forces[title].numpy())
        colour = next((c for name, c in LOSS_COLOURS.items() if title.startswith(name)), BLACK)
        draw_points(ax, points[title], colour, s=5)
        _draw_arrows(ax, points[title][::every].numpy(), forces[title][::every].numpy(), colour, scales[title])
        ax.set_title(title)
    for ax in list(axes.flat)[len(points) :]:
        ax.set_visible(False)
    return figure


def _draw_arrows(ax: Axes, places: np.ndarray, arrows: np.ndarray, colour: str, scale: float) -> None:
    lines = {"angles": "xy", "scale_units": "xy", "scale": 1, "width": 0.006, "headwidth": 3.5, "headlength": 4}
    lengths = np.linalg.norm(arrows, axis=1)
    # A point at rest would be drawn as a dot of its own.
    seen = lengths > 1e-3
    drawn = arrows[seen] * (np.minimum(lengths[seen] * scale, LONGEST_ARROW) / lengths[seen])[:, None]
    ax.quiver(*places[seen].T, *drawn.T, color=colour, zorder=4, **lines)


def _arrow_scales(forces: Mapping[str, Tensor]) -> dict[str, float]:
    """For every title what makes most arrows of its loss a third of a unit long or shorter, at whatever moment."""
    large: dict[str, float] = {}
    for title, arrows in forces.items():
        loss = title.split(",")[0]
        large[loss] = max(large.get(loss, 1e-3), float(np.quantile(arrows.norm(dim=1).numpy(), 0.9)))
    return {title: 0.3 / large[title.split(",")[0]] for title in forces}


def _draw_directions(ax: Axes, places: np.ndarray, arrows: np.ndarray) -> None:
    lengths = np.linalg.norm(arrows, axis=1, keepdims=True)
    directions = arrows / np.where(lengths > 0, lengths, 1)
    ax.quiver(*places.T, *directions.T, color="0.72", zorder=0, pivot="mid", scale=26, width=0.005)


def curves_figure(
    curves: Mapping[str, Mapping[str, tuple[Sequence[float], Sequence[float]]]],
    x_label: str,
    marks: Mapping[str, Mapping[str, float]] | None = None,
    scales: tuple[str, str] = ("symlog", "log"),
) -> Figure:
    """One panel under another, each with a curve for every loss.

    Parameters
    ----------
    curves : mapping
        Label of the vertical axis (with its unit) → name of the loss → (x, y).
    x_label : str
        With its unit.
    marks : mapping, optional
        Label of the vertical axis → what it is → a height to mark by a thin line.
    scales : tuple of str
        Of the horizontal and the vertical axes, as matplotlib names them.
    """
    options = {"figsize": (WIDTH, 2.5 * len(curves)), "layout": "constrained", "sharex": True, "squeeze": False}
    figure, axes = plt.subplots(len(curves), 1, **options)
    for ax, (label, lines) in zip(axes[:, 0], curves.items()):
        markers = itertools.cycle("os^Dv")
        for name, (x, y) in lines.items():
            ax.plot(x, y, label=name, **(loss_line(name) if name in LOSS_COLOURS else {"marker": next(markers)}))
        for (text, height), dashes in zip((marks or {}).get(label, {}).items(), itertools.cycle((":", "--"))):
            ax.axhline(height, color=TARGET, linewidth=1.4, linestyle=dashes, label=text)
        ax.set(ylabel=label, yscale=scales[1])
        if scales[1] == "log":
            _label_decades(ax)
        ax.set_xscale(scales[0], **({"linthresh": 1} if scales[0] == "symlog" else {}))
    axes[-1, 0].set_xlabel(x_label)
    handles, names = axes[-1, 0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside upper center", ncols=2 if len(names) > 3 else len(names))
    return figure


def _label_decades(ax: Axes) -> None:
    """Few labels in plain numbers, also where an axis spans less than a decade."""
    low, high = ax.get_ylim()
    steps = (1.0,) if high / low > 200 else (1.0, 2.0, 5.0)
    ax.yaxis.set_major_locator(LogLocator(subs=steps))
    ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.yaxis.set_minor_formatter(NullFormatter())


def _panels(n_rows: int, n_columns: int, contour: Contour) -> tuple[Figure, np.ndarray]:
    limits = box_around(contour)
    aspect = (limits[3] - limits[2]) / (limits[1] - limits[0])
    height = WIDTH / n_columns * aspect + 0.35
    options = {"figsize": (WIDTH, n_rows * height), "layout": "constrained", "squeeze": False}
    figure, axes = plt.subplots(n_rows, n_columns, **options)
    for ax in axes.flat:
        ax.set(xlim=limits[:2], ylim=limits[2:])
        ax.set_axis_off()
    return figure, axes


def box_around(contour: Contour, margin: float = 0.12) -> Limits:
    """Left, right, bottom and top of a box around a contour and the unit circle, with a margin."""
    corners = contour.vertices.detach().cpu().numpy()
    low, high = np.minimum(corners.min(axis=0), -1) - margin, np.maximum(corners.max(axis=0), 1) + margin
    return float(low[0]), float(high[0]), float(low[1]), float(high[1])


def _steps(step: int) -> str:
    return "start" if step == 0 else f"after {step} step" + "s" * (step != 1)
