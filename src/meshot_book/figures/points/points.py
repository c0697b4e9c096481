"""Pictures of points on their way to a contour: the process, the forces, the curves."""

import dataclasses
import itertools
from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from meshot.errors import require_positive_integer
from meshot.mesh import Contour
from meshot.types import Array, Float, Tensor
from meshot.view import BLACK, BLUE, GREY, LOSS_COLOURS, TARGET, WIDTH, loss_line

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
        arrows = forces[title][::every].numpy()
        lines = {"angles": "xy", "scale_units": "xy", "scale": 1, "width": 0.006, "headwidth": 3.5, "headlength": 4}
        lengths = np.linalg.norm(arrows, axis=1)
        # A point at rest would be drawn as a dot of its own.
        seen = lengths > 1e-3
        drawn = arrows[seen] * (np.minimum(lengths[seen] * scales[title], LONGEST_ARROW) / lengths[seen])[:, None]
        ax.quiver(*points[title][::every].numpy()[seen].T, *drawn.T, color=colour, zorder=4, **lines)
        ax.set_title(title)
    for ax in list(axes.flat)[len(points) :]:
        ax.set_visible(False)
    return figure


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
            low, high = ax.get_ylim()
            steps = (1.0,) if high / low > 200 else (1.0, 2.0, 5.0)
            ax.yaxis.set_major_locator(LogLocator(subs=steps))
            ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
            ax.yaxis.set_minor_formatter(NullFormatter())
        ax.set_xscale(scales[0], **({"linthresh": 1} if scales[0] == "symlog" else {}))
    axes[-1, 0].set_xlabel(x_label)
    handles, names = axes[-1, 0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside upper center", ncols=2 if len(names) > 3 else len(names))
    return figure


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


# Directions in space as lines through a half sphere, seen from above.


def directions_figure(sets: Mapping[str, Float[Tensor, "L 3"]], columns: int = 2) -> Figure:
    """A disc for each set: every line as the place where it leaves the upper half sphere, equal areas kept equal.

    θ and −θ are one line and one place. The rim is the horizon; opposite places on it are the same line.

    Parameters
    ----------
    sets : mapping
        Title → unit rows in R³.
    columns : int
        Discs in a row.
    """
    rows = -(-len(sets) // columns)
    size = (WIDTH, rows * (WIDTH / columns + 0.3))
    figure, axes = plt.subplots(rows, columns, figsize=size, layout="constrained", squeeze=False)
    for ax in axes.flat:
        ax.set_axis_off()
    for ax, (title, directions) in zip(axes.flat, sets.items()):
        places = disc_places(directions.detach().cpu().numpy())
        ax.add_patch(plt.Circle((0, 0), 1, facecolor="none", edgecolor=GREY, linewidth=1.5))
        ax.scatter(places[:, 0], places[:, 1], color=BLUE, s=22, linewidths=0)
        ax.set(xlim=(-1.05, 1.05), ylim=(-1.05, 1.05), aspect="equal", title=title)
    return figure


def disc_places(directions: Float[Array, "L 3"]) -> Float[Array, "L 2"]:
    """Lambert's projection of the upper half sphere onto the unit disc, after turning every line upward."""
    upward = directions * np.where(directions[:, 2:] < 0, -1.0, 1.0)
    return upward[:, :2] / np.sqrt(1 + upward[:, 2:])


# Descent directions side by side: points, their target, and the direction at every point.

SMALLEST = 1e-3  # in mm; a shorter arrow is not drawn


@dataclasses.dataclass(frozen=True, eq=False)
class ForceField:
    """What one panel shows.

    Parameters
    ----------
    points : tensor
        What moves.
    forces : tensor
        The negative gradient at every point, in units of the points.
    target : tensor
        What is aimed at.
    """

    points: Float[Tensor, "n 2"]
    forces: Float[Tensor, "n 2"]
    target: Float[Tensor, "m 2"]


def force_panels(
    fields: Mapping[str, ForceField],
    limits: Limits,
    longest: float = np.inf,
    columns: int = 2,
    bar: float = 20.0,
    every: int = 1,
    typical: float | None = None,
    inset: float = 1.0,
) -> Figure:
    """One panel for every field, at equal scale, arrows at their true length or scaled by a stated factor.

    Parameters
    ----------
    fields : mapping
        By title, which may run over several lines; the loss that it begins with sets the colour.
    limits : four floats
        Left, right, bottom, top, in mm.
    longest : float
        In mm; longer arrows are cut to this length, and get a disc at their start, so that a cut is seen.
    columns : int
        Panels in a row.
    bar : float
        The length of the scale bar at the lower left, in mm.
    every : int
        Draw the arrow of every so-manieth point only.
    typical : float, optional
        In mm. In each panel all arrows are scaled by one factor, 1, 2 or 5 times a power of ten, the largest that
        leaves nine tenths of the arrows at most this long. The title states the factor. Left out: true lengths.
    inset : float
        A factor on the positions of the target. Below one it lies inside, where arrows along it do not hide it.

    Raises
    ------
    ValueError
        If there is nothing to show, ``columns`` or ``every`` is not a positive integer, or ``longest`` or
        ``typical`` is not above zero.
    """
    require_positive_integer(columns, "columns")
    require_positive_integer(every, "every")
    if not fields:
        raise ValueError("fields is empty; at least one force field is needed")
    if not longest > 0:
        raise ValueError(f"longest is {longest!r}; a length > 0 in mm is needed, or infinity for arrows never cut")
    if typical is not None and not typical > 0:
        raise ValueError(f"typical is {typical!r}; a length > 0 in mm is needed, or None for arrows at true length")
    factors = {title: _scale(field, typical) for title, field in fields.items()}
    if typical is not None:
        fields = {f"{title}\narrows × {factors[title]:g}": field for title, field in fields.items()}
        factors = dict(zip(fields, factors.values()))
    rows = -(-len(fields) // columns)
    lines = max(title.count("\n") + 1 for title in fields)
    height = WIDTH / columns * (limits[3] - limits[2]) / (limits[1] - limits[0]) + 0.24 * lines
    options = {"figsize": (WIDTH, rows * height), "layout": "constrained", "squeeze": False}
    figure, axes = plt.subplots(rows, columns, **options)
    for ax in axes.flat:
        ax.set(xlim=limits[:2], ylim=limits[2:], aspect="equal")
        ax.set_axis_off()
    for ax, (title, field) in zip(axes.flat, fields.items()):
        colour = next((c for name, c in LOSS_COLOURS.items() if title.startswith(name)), BLACK)
        factor = factors[title]
        points, forces, target = (x.detach().cpu().numpy() for x in (field.points, field.forces, field.target))
        ax.scatter(*(inset * target.T), s=22, facecolors="none", edgecolors=TARGET, marker="s", linewidths=1, zorder=1)
        ax.scatter(*points.T, s=9, color=colour, linewidths=0, zorder=3)
        points, forces = points[::every], factor * forces[::every]
        lengths = np.linalg.norm(forces, axis=1)
        cut = lengths > longest
        ax.scatter(*points[cut].T, s=70, facecolors="none", edgecolors=colour, zorder=3)
        # A point at rest would be drawn as a dot of its own.
        seen = lengths > SMALLEST * factor
        drawn = forces[seen] * (np.minimum(lengths[seen], longest) / lengths[seen])[:, None]
        arrow = {"angles": "xy", "scale_units": "xy", "scale": 1, "headwidth": 3.5, "headlength": 4}
        ax.quiver(*points[seen].T, *drawn.T, color=colour, zorder=4, units="inches", width=0.02, **arrow)
        ax.set_title(title)
    _draw_bar(axes[-1, 0], limits, bar)
    return figure


def _scale(field: ForceField, typical: float | None) -> float:
    """The largest of 1, 2 and 5 times a power of ten that leaves nine tenths of the arrows at most ``typical`` long."""
    if typical is None:
        return 1.0
    lengths = field.forces.detach().norm(dim=1)
    wanted = typical / max(float(lengths.quantile(0.9)), SMALLEST)
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(max(step * power for step in (1, 2, 5) if step * power <= wanted))


def _draw_bar(ax: Axes, limits: Limits, bar: float) -> None:
    left, low = limits[0] + 0.02 * (limits[1] - limits[0]), limits[2] + 0.03 * (limits[3] - limits[2])
    ax.plot([left, left + bar], [low, low], color=BLACK, linewidth=2.5, solid_capstyle="butt")
    ax.annotate(f"{bar:g} mm", (left, low), xytext=(0, 4), textcoords="offset points")
