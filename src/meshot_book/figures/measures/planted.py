"""Planted errors side by side: their sections through the surface, and what each metric makes of them."""

import dataclasses
import math
from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from meshot.mesh import Mesh, plane_section
from meshot.types import Array, Float, Tensor
from meshot.view import TARGET, VERMILLION, WIDTH, Page, live_page, still_of

Segments = Float[Array, "n 2 2"]


@dataclasses.dataclass(frozen=True, eq=False)
class Window:
    """A square that looks at a plane through a surface.

    Parameters
    ----------
    centre : tensor
        In the middle of the square, in space.
    axis : int
        The coordinate that the plane holds fixed: 0, 1 or 2.
    half : float
        Half the side of the square.
    """

    centre: Float[Tensor, " 3"]
    axis: int
    half: float

    def lines(self, mesh: Mesh) -> Segments:
        """What of a surface is seen: line segments relative to the middle of the square."""
        cut = plane_section(mesh, self.axis, float(self.centre[self.axis]))
        kept = [k for k in range(3) if k != self.axis]
        flat = (cut - self.centre)[:, :, kept].detach().cpu().double().numpy()
        return flat[(np.abs(flat) <= self.half).all(axis=2).any(axis=1)]


def sections_figure(panels: Mapping[str, tuple[Window, Mesh]], target: Mesh, columns: int = 3) -> Figure:
    """Each damaged surface over its target, in its window: the target grey and wide, the damaged one thin.

    Dots are where the plane crosses the edges of the damaged mesh: they say how finely it is cut.
    """
    rows = math.ceil(len(panels) / columns)
    size = (WIDTH, WIDTH / columns * 1.16 * rows + 0.4)
    figure, axes = plt.subplots(rows, columns, figsize=size, layout="constrained", squeeze=False)
    for ax in axes.flat[len(panels) :]:
        ax.set_visible(False)
    for ax, (name, (window, mesh)) in zip(axes.flat, panels.items()):
        ax.add_collection(LineCollection(window.lines(target), colors=TARGET, linewidths=4, alpha=0.6))
        lines = window.lines(mesh)
        ax.add_collection(LineCollection(lines, colors=VERMILLION, linewidths=1.4))
        ax.plot(*lines.reshape(-1, 2).T, ".", color=VERMILLION, markersize=3)
        ax.set(xlim=(-window.half, window.half), ylim=(-window.half, window.half), aspect="equal")
        ax.set(xticks=[], yticks=[])
        ax.set_title(name)
        ax.spines[:].set_visible(True)
        half = window.half
        length = round_length(half)
        ax.plot([0.92 * half - length, 0.92 * half], [-0.88 * half] * 2, color="0.2", linewidth=2)
        ground = {"facecolor": "white", "edgecolor": "none", "pad": 1.5, "alpha": 0.85}
        ax.text(0.94 * half, -0.84 * half, f"{length:g} mm", ha="right", va="bottom", bbox=ground)
    return figure


def round_length(half: float) -> float:
    """The longest of 1, 2, 5, 10, … that is at most half of ``half``: what a bar of scale shows."""
    magnitude = 10.0 ** math.floor(math.log10(half / 2))
    return magnitude * max(step for step in (1, 2, 5) if step * magnitude <= half / 2)


def ratio_figure(
    values: Sequence[Sequence[str]],
    ratios: Float[Array, "rows columns"],
    names: Sequence[str],
    metrics: Sequence[str],
    label: str,
    limits: tuple[float, float] = (2.0, 50.0),
) -> Figure:
    """A table whose cells are coloured by how far each value stands above its yardstick.

    Parameters
    ----------
    values : sequence of sequences
        What is written in the cells.
    ratios : array
        At or below the lower limit the cell stays white; infinity is drawn as the upper limit.
    names, metrics : sequences of str
        Of the rows and of the columns.
    label : str
        What the colours mean.
    limits : tuple

    Raises
    ------
    ValueError
        If the values, ratios and names do not belong together.
    """
    if ratios.shape != (len(names), len(metrics)) or [len(row) for row in values] != [len(metrics)] * len(names):
        raise ValueError(f"ratios has shape {ratios.shape}; ({len(names)}, {len(metrics)}) is needed, as many values")
    figure, ax = plt.subplots(figsize=(WIDTH, 0.36 * len(names) + 1.9), layout="constrained")
    shown = np.where(ratios > limits[0], np.minimum(ratios, limits[1]), np.nan)
    image = ax.imshow(shown, norm=LogNorm(*limits), cmap="viridis_r", aspect="auto")
    size = min(10, 100 / len(metrics))  # more columns are narrower
    for (i, j), ratio in np.ndenumerate(shown):
        dark = np.isfinite(ratio) and ratio > math.sqrt(limits[0] * limits[1])
        colour = "white" if dark else "black"
        ax.text(j, i, values[i][j], ha="center", va="center", fontsize=size, color=colour)
    ax.set_xticks(range(len(metrics)), metrics, rotation=50, ha="left", rotation_mode="anchor")
    ax.xaxis.tick_top()
    ax.set_yticks(range(len(names)), names)
    ax.tick_params(length=0)
    ax.spines[:].set_visible(False)
    bar = figure.colorbar(image, location="bottom", aspect=40, shrink=0.7, label=label, extend="max")
    ticks = [tick for tick in (1, 2, 3, 5, 10, 20, 30, 50, 100) if limits[0] <= tick <= limits[1]]
    bar.set_ticks(ticks, labels=[str(tick) for tick in ticks])
    bar.minorticks_off()
    return figure


# Planted errors that a reader chooses, small to large, with what each metric says: whole in itself, offline.

SEEN = 2.0


@dataclasses.dataclass(frozen=True, eq=False)
class PlantedState:
    """One error of one size.

    Parameters
    ----------
    size : str
        In words, with its unit.
    mesh : Mesh
    values : sequence of str
        What each metric says, as it is to be read.
    ratios : sequence of float
        Each value over its yardstick; infinite where the yardstick is zero.
    """

    size: str
    mesh: Mesh
    values: Sequence[str]
    ratios: Sequence[float]


def planted_player(
    target: Mesh,
    errors: Mapping[str, tuple[Window, Sequence[PlantedState]]],
    metrics: Sequence[str],
    description: str,
    note: str,
) -> Page:
    """A page with a choice of errors, a slider for the size, a section through the surface and a bar for each metric.

    A bar is as long as the value over its yardstick, on a logarithmic scale from a tenth to a hundred times, and grey
    up to twice the yardstick. A still picture comes first and stays where scripts may not run.

    Parameters
    ----------
    target : Mesh
    errors : mapping
        By name: where to look, and the states in the order of the slider.
    metrics : sequence of str
    description : str
        What is to be seen, for those who do not see it.
    note : str
        Under the bars: what the yardstick is.

    Raises
    ------
    ValueError
        If there is no description, no error, or a state has not one value and one ratio for each metric.
    """
    if not description.strip():
        raise ValueError("description is empty; say what is to be seen, for readers who do not see it")
    if not errors or not all(states for _, states in errors.values()):
        raise ValueError("errors is empty, or one of them has no state; each needs at least one")
    for name, (_, states) in errors.items():
        if any(len(state.values) != len(metrics) or len(state.ratios) != len(metrics) for state in states):
            raise ValueError(f"{name!r} does not have one value and one ratio for each of {len(metrics)} metrics")
    listed = [_error(name, target, *error) for name, error in errors.items()]
    panels = {name: (window, states[-1].mesh) for name, (window, states) in errors.items()}
    return live_page(
        "meshot_book/figures/assets/planted",
        {"metrics": list(metrics), "errors": listed, "seen": SEEN},
        f"PlantedPlayer({len(errors)} errors; run the cell to choose one)",
        alt=description,
        still=still_of(sections_figure(panels, target)),
        names=list(errors),
        note=note,
    )


def _error(name: str, target: Mesh, window: Window, states: Sequence[PlantedState]) -> dict:
    listed = [
        {
            "size": state.size,
            "lines": _flat(window, state.mesh),
            "values": list(state.values),
            "ratios": [None if math.isinf(ratio) else float(f"{ratio:.3g}") for ratio in state.ratios],
        }
        for state in states
    ]
    frame = {"half": window.half, "bar": round_length(window.half)}
    return {"name": name} | frame | {"target": _flat(window, target), "states": listed}


def _flat(window: Window, mesh: Mesh) -> list[float]:
    """The segments as plain numbers in hundredths of the half window, cut off beyond twice of it."""
    places = np.clip(100 * window.lines(mesh) / window.half, -200, 200)
    return [round(float(x), 1) for x in places.reshape(-1)]
