"""Descent directions side by side: points, their target, and the direction at every point."""

import dataclasses
from collections.abc import Mapping

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from meshot.errors import require_positive_integer
from meshot.types import Float, Tensor
from meshot.view import BLACK, LOSS_COLOURS, TARGET, WIDTH

Limits = tuple[float, float, float, float]
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
        _draw_field(ax, field, colour, longest, every, factors[title])
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


def _draw_field(ax: Axes, field: ForceField, colour: str, longest: float, every: int, factor: float) -> None:
    points, forces, target = (x.detach().cpu().numpy() for x in (field.points, field.forces, field.target))
    ax.scatter(*target.T, s=22, facecolors="none", edgecolors=TARGET, marker="s", linewidths=1, zorder=1)
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


def _draw_bar(ax: Axes, limits: Limits, bar: float) -> None:
    left, low = limits[0] + 0.02 * (limits[1] - limits[0]), limits[2] + 0.03 * (limits[3] - limits[2])
    ax.plot([left, left + bar], [low, low], color=BLACK, linewidth=2.5, solid_capstyle="butt")
    ax.annotate(f"{bar:g} mm", (left, low), xytext=(0, 4), textcoords="offset points")
