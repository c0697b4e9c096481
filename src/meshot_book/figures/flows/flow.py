"""Pictures of flows: grids that bend, trajectories, errors over steps, shares over two settings."""

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
import torch
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter, ScalarFormatter

from meshot.errors import require_choice, require_positive_integer
from meshot.flow import VelocityField, integrate
from meshot.mesh import Mesh, plane_section
from meshot.types import Array, Float, Tensor
from meshot.view import (
    BLACK,
    BLUE,
    GREEN,
    LINE_COLOURS,
    ORANGE,
    PLANES,
    PURPLE,
    SKY,
    VERMILLION,
    WIDTH,
    legend_above,
    slice_image,
)
from meshot.volume import Volume
from meshot_book.flows import AnalyticField, Push, Vortex

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


# What a velocity field looks like: a slice of the image with an arrow at every place of a grid.


@torch.no_grad()
def velocities_on_slice(
    field: VelocityField, volume: Volume, plane: str, position_mm: float, n_arrows: int, like: Tensor
) -> tuple[Float[Array, "n 3"], Float[Array, "n 3"]]:
    """Places of an even grid on a plane through a volume, and the velocity at time 0 there, in mm per unit of time."""
    require_positive_integer(n_arrows, "n_arrows")
    require_choice(plane, "plane", PLANES)
    axis, shown, _ = PLANES[plane]
    left, right, bottom, top = slice_image(volume, axis, position_mm)[1]
    spacing = max(right - left, top - bottom) / n_arrows
    across, along = (np.arange(low + spacing / 2, high, spacing) for low, high in ((left, right), (bottom, top)))
    points = np.full((len(along), len(across), 3), float(position_mm))
    points[..., shown[0]], points[..., shown[1]] = across, along[:, None]
    places = torch.from_numpy(points.reshape(-1, 3)).to(like)
    moves = field.prepared()(places.new_zeros(()), places)
    return places.double().cpu().numpy(), moves.double().cpu().numpy()


def velocity_figure(
    field: VelocityField,
    volume: Volume,
    plane: str,
    position_mm: float,
    meshes: Mapping[str, Mesh] | None = None,
    n_arrows: int = 36,
    magnification: float = 1.0,
    longest: float | None = None,
) -> Figure:
    """A slice with arrows: their direction and length are the velocity within the slice, their colour its whole speed.

    Parameters
    ----------
    field : VelocityField
    volume : Volume
    plane : str
        "axial", "coronal" or "sagittal".
    position_mm : float
        Where the plane is.
    n_arrows : int
        Along the longer side.
    meshes : mapping, optional
        Surfaces by name, drawn where they meet the slice; the arrows get the dtype of the first.
    magnification : float
        How many times longer arrows are drawn than the way that the velocity would lead.
    longest : float, optional
        The speed at the end of the colour bar, in mm per unit of time; the 99th percentile if left out.

    Raises
    ------
    ValueError
        If the plane has another name, ``n_arrows`` is not a positive integer, or ``magnification`` is not positive.
    """
    if not magnification > 0:
        raise ValueError(f"magnification is {magnification!r}; a number > 0 is needed")
    meshes = meshes or {}
    like = next((mesh.vertices for mesh in meshes.values()), torch.zeros(0))
    places, moves = velocities_on_slice(field, volume, plane, position_mm, n_arrows, like)
    axis, shown, _ = PLANES[plane]
    image, extent = slice_image(volume, axis, position_mm)
    speeds = np.linalg.norm(moves, axis=1)
    top = longest or max(float(np.quantile(speeds, 0.99)), 1e-12)
    ratio = (extent[3] - extent[2]) / (extent[1] - extent[0])
    figure, ax = plt.subplots(figsize=(WIDTH, min(0.82 * WIDTH * ratio, 1.1 * WIDTH) + 0.8), layout="constrained")
    ax.imshow(image, extent=extent, origin="lower", cmap="gray", alpha=0.55)
    for (name, mesh), colour in zip(meshes.items(), LINE_COLOURS, strict=False):
        segments = plane_section(mesh, axis, position_mm)[:, :, list(shown)].detach().cpu().numpy()
        ax.add_collection(LineCollection(segments, colors=colour, linewidths=1.5, label=name), autolim=False)
    flat = magnification * moves[:, list(shown)]
    arrows = {"angles": "xy", "scale_units": "xy", "scale": 1, "width": 0.003, "cmap": "viridis", "clim": (0, top)}
    drawn = ax.quiver(*places[:, list(shown)].T, *flat.T, speeds, **arrows)
    label = "speed (mm per unit of time)" + (f"; arrows × {magnification:g}" if magnification != 1 else "")
    figure.colorbar(drawn, ax=ax, label=label, location="bottom", shrink=0.7, aspect=35)
    ax.set(xlabel=f"{'xyz'[shown[0]]} (mm)", ylabel=f"{'xyz'[shown[1]]} (mm)", aspect="equal")
    if meshes:
        figure.legend(loc="outside upper center", ncols=len(meshes))
    return figure


# Two triangles under a flow of their points: a page on which a reader makes them cross, whole in itself, offline.

LOWER = [[-1.0, 0.0], [0.0, -1.0], [1.0, 0.0]]
#: What the page offers to move the triangles, by the names that its buttons have.
FIELDS: dict[str, AnalyticField] = {"push": Push(-1.0, 0.3), "whirl": Vortex(6.0, 0.5)}


def two_triangles(gap: float = 0.3) -> Float[Tensor, "2 3 2"]:
    """A triangle below, its upper side on y = 0 from −1 to 1, and one above with its tip at (0, gap).

    The section, at z = 0, through a pair of triangles in space as in :func:`meshot_book.examples.tip_over_face`.

    Raises
    ------
    ValueError
        If the gap is not in (0, 1).
    """
    if not 0 < gap < 1:
        raise ValueError(f"gap is {gap!r}; a height in (0, 1) is needed")
    upper = [[0.0, gap], [0.4, gap + 1], [-0.4, gap + 1]]
    return torch.tensor([LOWER, upper], dtype=torch.float64)


def outlines(
    field: AnalyticField, corners: Float[Tensor, "k 3 2"], time: float, n_steps: int, n_pieces: int
) -> Float[Tensor, "k m 2"]:
    """The outlines of triangles with every side cut into ``n_pieces``, moved for ``time`` by Euler steps.

    Only the cuts are moved; between them the outline is straight.

    Raises
    ------
    ValueError
        If a count is not a positive integer.
    """
    require_positive_integer(n_pieces, "n_pieces")
    shares = torch.arange(n_pieces, dtype=corners.dtype)[:, None] / n_pieces
    starts, ends = corners[:, :, None], corners.roll(-1, dims=1)[:, :, None]
    points = (starts + shares * (ends - starts)).flatten(0, 2)
    moved = integrate(lambda t, x: time * field(t, x), points, n_steps)
    return moved.reshape(len(corners), 3 * n_pieces, 2)


def crossing_figure(field: AnalyticField, gap: float, time: float, n_steps: int, pieces: tuple[int, ...]) -> Figure:
    """Two triangles moved for some time, a panel for every number of pieces that their sides are cut into."""
    # Dotted: where the flow takes the sides themselves.
    corners = two_triangles(gap)
    curves = outlines(field, corners, time, n_steps, 64)
    size = (WIDTH, 1.3 * WIDTH / len(pieces))
    figure, axes = plt.subplots(1, len(pieces), figsize=size, layout="constrained", squeeze=False, sharey=True)
    for ax, n_pieces in zip(axes[0], pieces):
        moved = outlines(field, corners, time, n_steps, n_pieces)
        for straight, curve, colour in zip(moved.numpy(), curves.numpy(), (BLUE, ORANGE)):
            ax.fill(*straight.T, facecolor=(colour, 0.35), edgecolor=colour, linewidth=2)
            ax.plot(*np.vstack([curve, curve[:1]]).T, color="0.25", linewidth=1.2, linestyle=":")
        title = "corners only" if n_pieces == 1 else f"sides in {n_pieces} pieces"
        ax.set(title=title, xlabel="$x$ (units)", aspect="equal", xlim=(-1.6, 1.6), ylim=(-2.1, 1.5))
    axes[0, 0].set_ylabel("$y$ (units)")
    return figure


def crossing_data(gap: float = 0.3) -> dict:
    """What the live figure ``crossing`` needs: two triangles with a gap between them, and the fields that move them."""
    fields = {}
    for name, field in FIELDS.items():
        reach = field.width if isinstance(field, Push) else field.radius
        fields[name] = {"strength": field.strength, "reach": reach, "lipschitz": float(field.lipschitz_bound())}
    return {"corners": two_triangles(gap).tolist(), "fields": fields, "time": 0.6, "steps": 8}


def contour_data() -> dict:
    """Data of the live figure ``contour``, in mm: a contour with five folds, and a circle with even or uneven edges."""
    angles = 2 * np.pi * np.arange(160) / 160
    target = (40 + 10 * np.cos(5 * angles))[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    even = 2 * np.pi * (np.arange(40) + 0.3) / 40
    circles = {
        name: 40 * np.stack([np.cos(at), np.sin(at)], axis=1)
        for name, at in {"even": even, "uneven": even + 0.6 * np.sin(even)}.items()
    }
    starts = {name: points.round(3).tolist() for name, points in circles.items()}
    return {"starts": starts, "target": target.round(3).tolist(), "lines": 24}
