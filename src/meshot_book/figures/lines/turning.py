"""One line through the plane: what two clouds cast on it, how sorting pairs them, and the cost over all angles."""

import math

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from meshot.types import Array, Float, Tensor
from meshot.view import BLACK, BLUE, GREY, ORANGE, WIDTH

#: Distances of the two rows of projections from the middle, in radii of the clouds.
ROWS = (1.25, 1.5)


def turning_figure(source: Float[Tensor, "n 2"], target: Float[Tensor, "n 2"], angle: float) -> Figure:
    """Two clouds of equally many points, a line at an angle with its sorted pairs, and the cost by angle."""
    x, y = (points.detach().cpu().double().numpy() for points in (source, target))
    figure, (plane, curve) = plt.subplots(1, 2, figsize=(WIDTH, 0.56 * WIDTH), layout="constrained")
    _draw_plane(plane, x, y, math.radians(angle))
    degrees = np.arange(180)
    costs = line_costs(x, y, degrees)
    curve.plot(degrees, costs, color=BLACK)
    curve.axhline(costs.mean(), color=GREY, linestyle="--")
    curve.set_title("dashed: mean over all angles", fontsize=11)
    curve.plot([angle], line_costs(x, y, np.array([angle])), "o", color=BLACK, markersize=8)
    curve.set(xlabel="angle of the line (degrees)", ylabel="$W_2^2$ on the line (units²)", ylim=(0, None))
    curve.set_xticks([0, 45, 90, 135, 180])
    return figure


def line_costs(source: Float[Array, "n 2"], target: Float[Array, "n 2"], degrees: Array) -> Float[Array, " L"]:
    """W₂² on the lines at these angles, to be drawn: the mean over sorted pairs."""
    lines = np.stack([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))], axis=1)
    gaps = np.sort(lines @ source.T, axis=1) - np.sort(lines @ target.T, axis=1)
    return np.square(gaps).mean(axis=1)


def radius_of(source: Array, target: Array) -> float:
    """The largest distance from the middle of the picture."""
    return float(np.linalg.norm(np.concatenate([source, target]), axis=1).max())


def _draw_plane(ax: Axes, source: Array, target: Array, angle: float) -> None:
    along, across = np.array([math.cos(angle), math.sin(angle)]), np.array([math.sin(angle), -math.cos(angle)])
    radius, feet = radius_of(source, target), []
    for points, row, colour, marker, name in ((source, 0, BLUE, "o", "source"), (target, 1, ORANGE, "s", "target")):
        foot = (points @ along)[:, None] * along + ROWS[row] * radius * across
        feet.append(foot[np.argsort(points @ along)])
        for point, end in zip(points, foot):
            ax.plot(*np.stack([point, end]).T, color=colour, linewidth=0.6, alpha=0.4, zorder=1)
        ends = np.outer([-1.1 * radius, 1.1 * radius], along) + ROWS[row] * radius * across
        ax.plot(*ends.T, color=GREY, linewidth=1, zorder=1)
        ax.scatter(*points.T, color=colour, marker=marker, s=26, zorder=3, label=name)
        ax.scatter(*foot.T, color=colour, marker=marker, s=14, zorder=3)
    for pair in zip(*feet):
        ax.plot(*np.stack(pair).T, color=BLACK, linewidth=1, zorder=2)
    limit = 1.9 * radius
    ax.set(xlim=(-limit, limit), ylim=(-limit, limit), aspect="equal", xlabel="$x$ (units)", ylabel="$y$ (units)")
    ax.legend(loc="upper left", fontsize=9, handletextpad=0.1)
