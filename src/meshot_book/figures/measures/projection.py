"""Pictures of projected distributions: densities with their atoms, distribution functions, a turning direction."""

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
import torch
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from meshot.loss import ProjectedLaw, projected_law
from meshot.measure import SurfaceMeasure
from meshot.types import Array, Float
from meshot.view import BLACK, BLUE, GREY, ORANGE, WIDTH

FIRST_ATOM = 1e-3  # an atom below this mass would only blur the axis


def draw_density(ax: Axes, law: ProjectedLaw, colour: str = BLUE, points: Float[Array, " n"] | None = None) -> None:
    """Draw the density of a law; atoms as pins of one height, their mass beside them; a histogram behind."""
    if points is not None:
        ax.hist(points, bins=80, density=True, color=ORANGE, alpha=0.55, label=f"{len(points):,} points")
    wide = law.extents > 0
    x = np.stack([law.starts, law.starts + law.extents], axis=1)[wide].reshape(-1)
    heights = np.pad(law.densities[wide].reshape(-1), 1)  # down to zero at either end
    ax.plot(np.pad(x, 1, mode="edge"), heights, color=colour, label="exact density")
    top = max(float(law.densities.max(initial=0)), 1e-9) * 1.25
    for position, mass in zip(*law.atoms):
        if mass > FIRST_ATOM:
            ax.plot([position, position], [0, top], color=BLACK, linewidth=1.6)
            ax.plot(position, top, "o", color=BLACK, markersize=6)
            inwards = 1 if position < law.starts.mean() else -1  # the mass stands beside the pin, within the frame
            place = {"textcoords": "offset points", "ha": "left" if inwards > 0 else "right", "va": "center"}
            ax.annotate(f"{mass:.2g}", (position, top), (7 * inwards, 2), fontsize=11, **place)
    ax.set_ylim(0, top * 1.3)


def law_figure(
    laws: Mapping[str, ProjectedLaw], points: Mapping[str, Float[Array, " n"]] | None = None, unit: str = "units"
) -> Figure:
    """A row for each law: its density (with a histogram of points, if given), and its distribution function.

    Parameters
    ----------
    laws : mapping
        By title.
    points : mapping, optional
        Projected points, by the same titles.
    unit : str
        Of length.
    """
    options = {"figsize": (WIDTH, 1.75 * len(laws) + 0.5), "layout": "constrained", "squeeze": False}
    figure, axes = plt.subplots(len(laws), 2, **options)
    for (left, right), (title, law) in zip(axes, laws.items()):
        draw_density(left, law, points=(points or {}).get(title))
        low, high = law.starts[0], law.starts[-1] + law.extents[-1]
        x = np.linspace(low - 0.08 * (high - low), high + 0.08 * (high - low), 801)
        right.plot(x, law.distribution(x), color=BLUE)
        left.set(title=title, ylabel=f"density (1/{unit})", xlim=(x[0], x[-1]))
        right.set(ylabel="$F$", xlim=(x[0], x[-1]), ylim=(-0.03, 1.06))
    for ax in axes[-1]:
        ax.set_xlabel(f"position on the line ({unit})")
    return figure


def turned_densities_figure(measure: SurfaceMeasure, angles: Sequence[float]) -> Figure:
    """A film strip: a shape from above with the direction that turns, and below each picture the projected density.

    Parameters
    ----------
    measure : SurfaceMeasure
        In R³ or R²; the direction turns in the plane of the first two coordinates.
    angles : sequence of float
        In degrees from the first axis.
    """
    figure, axes = plt.subplots(2, len(angles), figsize=(WIDTH, 3.6), layout="constrained", sharex="row", sharey="row")
    d = measure.vertices.shape[1]
    laws = []
    for ax, angle in zip(axes[0], angles):
        theta = torch.zeros(d, dtype=measure.vertices.dtype)
        theta[0], theta[1] = np.cos(np.radians(angle)), np.sin(np.radians(angle))
        laws.append(projected_law(measure, theta))
        corners = measure.vertices[measure.cells][..., :2].numpy()
        for cell in corners:
            closed = np.concatenate([cell, cell[:1]])
            ax.plot(closed[:, 0], closed[:, 1], color=GREY, linewidth=0.8)
        reach = 0.75 * float(np.abs(corners).max())
        arrow = {"arrowstyle": "-|>", "color": BLUE, "linewidth": 2}
        ax.annotate("", 1.9 * reach * theta[:2].numpy(), (0, 0), arrowprops=arrow)
        ax.set(xlim=(-2.1 * reach, 2.1 * reach), ylim=(-2.1 * reach, 2.1 * reach))
        ax.set_aspect("equal")
        ax.set_axis_off()
        ax.set_title(f"{angle:g}°")
    for ax, law in zip(axes[1], laws):
        draw_density(ax, law)
        ax.margins(x=0.25)  # room for the mass beside an atom at the end
        ax.set_xlabel("position")
    axes[1, 0].set_ylim(0, 1.6 * max(float(law.densities.max()) for law in laws))
    axes[1, 0].set_ylabel("density")
    return figure
