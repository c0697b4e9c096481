"""Schematic pictures: three encodings of a contour, the two banks of a sulcus, a k-d tree."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from meshot.measure import empirical
from meshot.mesh import Contour
from meshot.types import Array, Float
from meshot.view import BLACK, BLUE, GREY, VERMILLION, WIDTH


def encodings_figure(contour: Contour, n_points: int = 24, seed: int = 0) -> Figure:
    """Three panels: the continuous measure on a contour, an empirical measure, and the oriented varifold.

    Parameters
    ----------
    contour : Contour
        In the plane, its edges counter-clockwise, so that normals point outwards.
    n_points : int
        Points of the empirical measure.
    seed : int
        Of the draw.
    """
    ends = contour.vertices[contour.edges].detach().numpy()
    along = ends[:, 1] - ends[:, 0]
    lengths = np.hypot(*along.T)
    figure, axes = plt.subplots(1, 3, figsize=(WIDTH, 0.42 * WIDTH), sharex=True, sharey=True)
    for ax, title in zip(axes, ("continuous", "empirical", "varifold")):
        look = {"linewidth": 4, "color": BLUE} if title == "continuous" else {"linewidth": 1, "color": GREY}
        for first, last in ends:
            ax.plot(*zip(first, last), solid_capstyle="round", **look)
        ax.set(title=title, aspect="equal")
        ax.margins(0.15)
        ax.set_axis_off()
    axes[1].scatter(*empirical(contour, n_points, seed).points.detach().numpy().T, s=20, color=VERMILLION, zorder=3)
    normals = np.stack([along[:, 1], -along[:, 0]], axis=1) / lengths[:, None]
    middles, reach = ends.mean(axis=1), 0.11 * np.ptp(ends.reshape(-1, 2), axis=0).max()
    axes[2].scatter(*middles.T, s=90 * lengths / lengths.max(), color=VERMILLION, zorder=3)
    for middle, normal in zip(middles, normals):
        _draw_arrow(axes[2], middle, middle + reach * normal)
    return figure


def banks_figure() -> Figure:
    """Two panels: a blade, two sheets whose normals point outwards, and a slit, where they point inwards."""
    figure, axes = plt.subplots(1, 2, figsize=(0.9 * WIDTH, 0.36 * WIDTH))
    for ax, title, sign in zip(axes, ("blade: normals outwards", "slit: normals inwards"), (1, -1)):
        for x, side in ((0.0, -1), (2.0, 1)):
            ax.plot([x, x], [0, 4], color=BLACK, linewidth=2.5)
            for y in (0.6, 2.0, 3.4):
                _draw_arrow(ax, (x, y), (x + 0.8 * sign * side, y))
        ax.annotate("", (2.0, -0.6), (0.0, -0.6), arrowprops={"arrowstyle": "<->"})
        ax.text(1.0, -0.5, "$g$", ha="center", va="bottom")
        ax.set(title=title, xlim=(-1.4, 3.4), ylim=(-0.9, 4.4))
        ax.set_axis_off()
    return figure


def _draw_arrow(ax: Axes, start: object, end: object) -> None:
    look = {"arrowstyle": "-|>", "color": BLUE, "linewidth": 1.8, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", end, start, arrowprops=look, annotation_clip=False)


def tree_figure(points: Float[Array, "n 2"], query: Float[Array, " 2"], leaf: int = 4) -> Figure:
    """The leaves of a k-d tree; shaded are those that a search for the nearest neighbour of the query opens.

    A leaf is opened if it comes nearer to the query than the nearest neighbour does.

    Parameters
    ----------
    points : array
    query : array
        Marked by a cross, with the circle through its nearest neighbour.
    leaf : int
        Most points in a leaf.
    """
    figure, ax = plt.subplots(figsize=(0.62 * WIDTH, 0.62 * WIDTH))
    gaps = np.hypot(*(points - query).T)
    low, high = points.min(axis=0) - 0.02, points.max(axis=0) + 0.02
    for corner, far in _leaves(points, low, high, leaf):
        outside = np.maximum(np.maximum(corner - query, query - far), 0)
        opened = np.hypot(*outside) < gaps.min()
        look = {"facecolor": BLUE, "alpha": 0.25, "hatch": "//"} if opened else {"facecolor": "none"}
        ax.add_patch(Rectangle(corner, *(far - corner), linewidth=0, **look))
        ax.add_patch(Rectangle(corner, *(far - corner), facecolor="none", edgecolor=GREY, linewidth=1))
    ax.plot(*points.T, "o", color=BLACK, markersize=4)
    ax.plot(*query, "x", color=VERMILLION, markersize=10, markeredgewidth=2.5)
    ax.add_patch(plt.Circle(query, gaps.min(), fill=False, color=VERMILLION, linewidth=1.5))
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    ax.set_axis_off()
    return figure


def _leaves(
    points: Float[Array, "n 2"], low: Float[Array, " 2"], high: Float[Array, " 2"], leaf: int, axis: int = 0
) -> list[tuple[Float[Array, " 2"], Float[Array, " 2"]]]:
    """The boxes of the leaves, cut in turn across either axis at the median."""
    if len(points) <= leaf:
        return [(low, high)]
    middle = float(np.median(points[:, axis]))
    below, above = points[points[:, axis] < middle], points[points[:, axis] >= middle]
    cut_high, cut_low = high.copy(), low.copy()
    cut_high[axis] = cut_low[axis] = middle
    return _leaves(below, low, cut_high, leaf, 1 - axis) + _leaves(above, cut_low, high, leaf, 1 - axis)
