"""Pictures of flows: grids that bend, trajectories, errors over steps, shares over two settings."""

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter, ScalarFormatter

from meshot.types import Array, Float, Tensor
from meshot.view import BLACK, BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILLION, WIDTH, legend_above

METHOD_LINES = {
    "euler": {"color": ORANGE, "linestyle": "-", "marker": "o"},
    "midpoint": {"color": SKY, "linestyle": "--", "marker": "s"},
    "rk4": {"color": PURPLE, "linestyle": "-.", "marker": "^"},
    "dopri5": {"color": GREEN, "linestyle": ":", "marker": "D"},
    "direct": {"color": ORANGE, "linestyle": "-", "marker": "o"},
    "adjoint": {"color": BLUE, "linestyle": "--", "marker": "s"},
}


def cell_areas(lattice: Float[Tensor, "rows columns 2"]) -> Float[Tensor, "cells_down cells_across"]:
    """The signed area of every cell of a bent lattice, its sides taken as straight; negative where it is turned over.

    Rows run along the first coordinate and columns along the second, as ``torch.meshgrid`` with "ij" makes them.
    """
    across, down = lattice[1:, 1:] - lattice[:-1, :-1], lattice[:-1, 1:] - lattice[1:, :-1]
    return (across[..., 0] * down[..., 1] - across[..., 1] * down[..., 0]) / 2


def bent_grid_figure(
    lattices: Mapping[str, Float[Tensor, "rows columns 2"]],
    paths: Mapping[str, Float[Tensor, "k n 2"]] | None = None,
    n_columns: int = 2,
    limits: float | None = None,
) -> Figure:
    """Where a flow takes the lines of a square grid: one panel per title, cells that are turned over filled in red.

    Parameters
    ----------
    lattices : mapping
        By title: positions of the nodes of a grid.
    paths : mapping, optional
        By title: paths of a few points, drawn over the grid with a dot at their end.
    n_columns : int
        Of panels.
    limits : float, optional
        Half the width of what is shown, around the origin; all of it by default.
    """
    n_rows = -(-len(lattices) // n_columns)
    size = (WIDTH, WIDTH / n_columns * 1.08 * n_rows)
    figure, axes = plt.subplots(n_rows, n_columns, figsize=size, layout="constrained", squeeze=False)
    reach = limits or 1.05 * max(float(lattice.abs().max()) for lattice in lattices.values())
    for ax, (title, lattice) in zip(axes.flat, lattices.items()):
        _draw_lattice(ax, lattice.detach().cpu())
        followed = (paths or {}).get(title)
        for path in () if followed is None else followed.detach().cpu().transpose(0, 1).numpy():
            ax.plot(*path.T, color=BLACK, linewidth=1.5, zorder=4)
            ax.plot(*path[-1], "o", color=BLACK, markersize=4, zorder=5)
        ax.set(title=title, xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
        ax.set(xlabel="$x$ (units)", ylabel="$y$ (units)")
        ax.label_outer()
    for ax in list(axes.flat)[len(lattices) :]:
        ax.set_visible(False)
    return figure


def _draw_lattice(ax: Axes, lattice: Tensor) -> None:
    nodes = lattice.numpy()
    lines = [*nodes, *nodes.transpose(1, 0, 2)]
    ax.add_collection(LineCollection(lines, colors="0.55", linewidths=0.8, zorder=2))
    over = np.argwhere(cell_areas(lattice).numpy() < 0)
    corners = [nodes[[i, i + 1, i + 1, i], [j, j, j + 1, j + 1]] for i, j in over]
    ax.add_collection(PolyCollection(corners, facecolors=VERMILLION, alpha=0.55, zorder=3))


def map_figure(maps: Mapping[str, Float[Tensor, "rows columns"]], extent: float, label: str) -> Figure:
    """Values over the square from −``extent`` to ``extent``, two maps in a row, each with its own scale of colours.

    Parameters
    ----------
    maps : mapping
        By title; rows run along x, columns along y.
    extent : float
        In units of the points.
    label : str
        What is coloured, with its unit.
    """
    n_rows = -(-len(maps) // 2)
    options = {"figsize": (WIDTH, 2.7 * n_rows), "layout": "constrained", "squeeze": False}
    figure, axes = plt.subplots(n_rows, 2, sharex=True, sharey=True, **options)
    for ax, (title, values) in zip(axes.flat, maps.items()):
        image = ax.imshow(
            values.detach().cpu().numpy().T, origin="lower", extent=(-extent, extent, -extent, extent), vmin=0
        )
        figure.colorbar(image, ax=ax)
        ax.set(title=title, xlabel="$x$ (units)", ylabel="$y$ (units)")
        ax.label_outer()
    for ax in list(axes.flat)[len(maps) :]:
        ax.set_visible(False)
    figure.suptitle(label)
    return figure


def trajectory_figure(
    panels: Mapping[str, tuple[Float[Tensor, " k"], Float[Tensor, "k n"]]],
    y_label: str = "$x$ (units)",
    columns: int = 1,
) -> Figure:
    """Positions on a line over time: a curve for every point, one panel per title.

    Parameters
    ----------
    panels : mapping
        By title: the times, and where each of n points is then.
    y_label : str
        With its unit.
    columns : int
        Panels in a row.
    """
    n_rows = -(-len(panels) // columns)
    options = {"layout": "constrained", "sharex": True, "sharey": True, "squeeze": False}
    figure, axes = plt.subplots(n_rows, columns, figsize=(WIDTH, 2.2 * n_rows), **options)
    for ax, (title, (times, positions)) in zip(axes.flat, panels.items()):
        marker = {"marker": "o", "markersize": 3} if len(times) < 12 else {}
        shades = plt.get_cmap("viridis")(np.linspace(0, 0.9, positions.shape[1]))
        for path, shade in zip(positions.detach().T.numpy(), shades):
            ax.plot(times.numpy(), path, color=shade, linewidth=1.3, **marker)
        ax.set(title=title, xlabel="time $t$", ylabel=y_label)
        ax.label_outer()
    return figure


def steps_figure(
    panels: Mapping[str, Mapping[str, tuple[Sequence[int], Sequence[float]]]], slopes: Mapping[str, int] | None = None
) -> Figure:
    """One panel beside another, both axes logarithmic: something over the number of steps, a line for each method.

    Parameters
    ----------
    panels : mapping
        Label of the vertical axis (with its unit) → name of the method → (numbers of steps, values).
    slopes : mapping, optional
        Method → order p, for the labels.
    """
    figure, axes = plt.subplots(1, len(panels), figsize=(WIDTH, 3.7), layout="constrained", squeeze=False)
    for ax, (label, lines) in zip(axes[0], panels.items()):
        for name, (steps, values) in lines.items():
            order = f", order {slopes[name]}" if slopes and name in slopes else ""
            ax.plot(steps, values, label=name + order, markersize=5, **METHOD_LINES.get(name, {"color": BLACK}))
        ax.set(xscale="log", yscale="log", xlabel="number of steps $n$", ylabel=label)
        ax.set_xticks(steps)
        ax.xaxis.set_major_formatter(ScalarFormatter())
        ax.xaxis.set_minor_formatter(NullFormatter())
    legend_above(figure, axes[0, 0])
    return figure


def share_figure(
    panels: Mapping[str, Array], row_labels: Sequence[str], column_labels: Sequence[str], x_label: str, y_label: str
) -> Figure:
    """Percentages over two settings as tables in colour, one under another, with the number in every field.

    Parameters
    ----------
    panels : mapping
        By title: percentages, rows × columns.
    row_labels, column_labels : sequence of str
    x_label, y_label : str
        With their units.
    """
    figure, axes = plt.subplots(
        len(panels), 1, figsize=(WIDTH, 2.3 * len(panels) + 0.4), layout="constrained", squeeze=False, sharex=True
    )
    most = max(float(np.max(values)) for values in panels.values())
    for ax, (title, values) in zip(axes[:, 0], panels.items()):
        ax.imshow(values, vmin=0, vmax=most or 1, aspect="auto")
        for (i, j), value in np.ndenumerate(np.asarray(values)):
            text = "0" if value == 0 else f"{value:.2g}"
            ax.text(j, i, text, ha="center", va="center", color="white" if value < 0.6 * most else "black", size=11)
        ax.set(title=title, ylabel=y_label)
        ax.set_yticks(range(len(row_labels)), row_labels)
        ax.set_xticks(range(len(column_labels)), column_labels)
        ax.spines[:].set_visible(False)
        ax.tick_params(length=0)
    axes[-1, 0].set_xlabel(x_label)
    return figure
