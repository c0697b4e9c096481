"""Pictures of measures on a line: points, couplings, distribution and quantile functions."""

import math
from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from meshot.types import Array, Float, Tensor
from meshot.view import BLACK, BLUE, GREY, ORANGE, TARGET, VERMILLION, WIDTH
from meshot_book.lines import MonotonePlan

BEHIND_TEXT = {"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none"}
Pairs = Sequence[tuple[int, int, float]]


def pairs_of(plan: MonotonePlan) -> list[tuple[int, int, float]]:
    """A plan as (source, target, mass) rows."""
    return list(zip(plan.source.tolist(), plan.target.tolist(), plan.masses.tolist()))


def draw_pairing(
    ax: Axes,
    source: tuple[Float[Tensor, " n"], Float[Tensor, " n"]],
    target: tuple[Float[Tensor, " m"], Float[Tensor, " m"]],
    pairs: Pairs,
) -> None:
    """Points of the source above, of the target below, and a line for every pair; those that cross are dashed.

    Parameters
    ----------
    ax : matplotlib axes
    source, target : pair of tensors
        Positions and masses; areas of the points and widths of the lines grow with the mass.
    pairs : sequence of (int, int, float)
        Source, target and mass; see :func:`meshot_book.figures.lines.pairs_of` for those of a plan.
    """
    (x, a), (y, b) = (tuple(v.detach().cpu().numpy() for v in side) for side in (source, target))
    for i, j, mass in pairs:
        crossed = any((x[i] - x[one]) * (y[j] - y[other]) < 0 for one, other, _ in pairs)
        style = {"color": VERMILLION, "linestyle": "--"} if crossed else {"color": BLUE}
        ax.plot([x[i], y[j]], [1, 0], linewidth=max(1, 24 * mass), alpha=0.65, zorder=1, **style)
    for places, masses, height, colour in ((x, a, 1, BLUE), (y, b, 0, GREY)):
        ax.scatter(places, np.full(len(places), height), s=1500 * masses, color=colour, edgecolors="white", zorder=2)
    ax.set(ylim=(-0.25, 1.25), yticks=[0, 1], yticklabels=["target", "source"])
    ax.spines["left"].set_visible(False)
    ax.tick_params(axis="y", length=0)


def pairing_figure(
    source: tuple[Float[Tensor, " n"], Float[Tensor, " n"]],
    target: tuple[Float[Tensor, " m"], Float[Tensor, " m"]],
    pairings: dict[str, Pairs],
) -> Figure:
    """One pairing under another, each with its title."""
    options = {"figsize": (WIDTH, 1.9 * len(pairings)), "layout": "constrained", "sharex": True, "squeeze": False}
    figure, axes = plt.subplots(len(pairings), 1, **options)
    for ax, (title, pairs) in zip(axes[:, 0], pairings.items()):
        draw_pairing(ax, source, target, pairs)
        ax.set_title(title)
    axes[-1, 0].set_xlabel("position on the line (units)")
    return figure


def step_heights(
    positions: Float[Tensor, " n"], weights: Float[Tensor, " n"]
) -> tuple[Float[Array, " n"], Float[Array, " k"]]:
    """The sorted positions, and the shares of mass at which the quantile function jumps: 0, …, 1."""
    places, masses = (v.detach().cpu().numpy() for v in (positions, weights))
    order = np.argsort(places, kind="stable")
    return places[order], np.concatenate([[0], np.cumsum(masses[order])])


def distribution_figure(
    source: tuple[Float[Tensor, " n"], Float[Tensor, " n"]], target: tuple[Float[Tensor, " m"], Float[Tensor, " m"]]
) -> Figure:
    """Left both distribution functions, right both quantile functions, with the area between them shaded."""
    figure, axes = plt.subplots(1, 2, figsize=(WIDTH, 3.1), layout="constrained")
    sides = [step_heights(*side) for side in (source, target)]
    low, high = (f(f(places) for places, _ in sides) for f in (min, max))
    margin = 0.08 * (high - low)
    grid = np.unique(np.concatenate([places for places, _ in sides] + [[low - margin, high + margin]]))
    levels = np.unique(np.concatenate([jumps for _, jumps in sides]))
    distributions, quantiles = [], []
    for places, jumps in sides:
        distributions.append(jumps[np.searchsorted(places, grid, side="right")])
        middles = (levels[:-1] + levels[1:]) / 2
        step = np.searchsorted(jumps, middles) - 1
        quantiles.append(places[[*step, step[-1]]])
    axes[0].fill_between(grid, *distributions, step="post", color=BLUE, alpha=0.15, linewidth=0)
    axes[1].fill_between(levels, *quantiles, step="post", color=BLUE, alpha=0.15, linewidth=0)
    for name, colour, dashes, f, q in zip(
        ("source", "target"), (BLUE, TARGET), ("-", "--"), distributions, quantiles, strict=True
    ):
        axes[0].step(grid, f, where="post", color=colour, linestyle=dashes, label=name)
        axes[1].step(levels, q, where="post", color=colour, linestyle=dashes)
    axes[0].set(xlabel="position $x$ (units)", ylabel="share of mass $F(x)$")
    axes[1].set(xlabel="share of mass $z$", ylabel="position $F^{-1}(z)$ (units)")
    figure.legend(loc="outside upper center", ncols=2)
    return figure


def cells_figure(
    source: tuple[Float[Tensor, " n"], Float[Tensor, " n"]],
    target: tuple[Float[Tensor, " m"], Float[Tensor, " m"]],
    plan: MonotonePlan,
) -> Figure:
    """The interval [0, 1] of mass cut by the source, by the target, and by both: the cells of the merged functions."""
    figure, ax = plt.subplots(figsize=(WIDTH, 2.6), layout="constrained")
    merged = plan.masses.detach().cpu().numpy()
    order = [step_heights(*side) for side in (source, target)]
    x, y = (side[0].detach().cpu().numpy() for side in (source, target))
    rows = [("source", 2, order[0][1], [f"{v:g}" for v in order[0][0]], BLUE)]
    rows.append(("target", 1, order[1][1], [f"{v:g}" for v in order[1][0]], GREY))
    names = [f"{x[i]:g}→{y[j]:g}" for i, j, _ in pairs_of(plan)]
    rows.append(("cells", 0, np.concatenate([[0], np.cumsum(merged)]), names, BLACK))
    for _, height, cuts, texts, colour in rows:
        for left, right, text in zip(cuts[:-1], cuts[1:], texts, strict=True):
            ax.barh(height, right - left, left=left, height=0.62, color=colour, alpha=0.25, edgecolor=colour)
            ax.text((left + right) / 2, height, text, ha="center", va="center", fontsize=11, bbox=BEHIND_TEXT)
    for cut in rows[-1][2][1:-1]:
        ax.axvline(cut, color=BLACK, linewidth=0.8, linestyle=":", zorder=0)
    ax.set(xlim=(0, 1), xlabel="share of mass $z$", yticks=[2, 1, 0], yticklabels=[row[0] for row in rows])
    ax.spines["left"].set_visible(False)
    ax.tick_params(axis="y", length=0)
    return figure


# One line through the plane: what two clouds cast on it, how sorting pairs them, and the cost over all angles.

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
