"""Planted errors side by side: their sections through the surface, and the values of each metric."""

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
from meshot.view import TARGET, VERMILLION, WIDTH

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

    def chains(self, mesh: Mesh) -> list[list[int]]:
        """The same lines, cut off at the square and joined where they meet: u₁, v₁, u₂, v₂, … in ¼ % of ``half``."""
        neighbours: dict[tuple[int, int], list[tuple[int, int]]] = {}
        for pair in np.rint(400 * _inside(self.lines(mesh) / self.half)).astype(int).tolist():
            a, b = map(tuple, pair)
            if a != b and b not in neighbours.get(a, []):  # two faces can share an edge in the plane
                neighbours.setdefault(a, []).append(b)
                neighbours.setdefault(b, []).append(a)
        chains = []
        # Open lines first, from one of their ends; what is left are rings.
        for start in sorted(neighbours, key=lambda place: len(neighbours[place]) % 2 == 0):
            while neighbours[start]:
                chain = [start]
                while neighbours[chain[-1]]:
                    after = neighbours[chain[-1]].pop()
                    neighbours[after].remove(chain[-1])
                    chain.append(after)
                chains.append([x for place in chain for x in place])
        return chains


def _inside(lines: Segments) -> Segments:
    """The parts of line segments within the square from −1 to 1."""
    start, way = lines[:, 0], lines[:, 1] - lines[:, 0]
    safe = np.where(way == 0, 1e-12, way)
    walls = np.stack([(-1 - start) / safe, (1 - start) / safe])
    first, last = np.maximum(walls.min(axis=0).max(axis=1), 0), np.minimum(walls.max(axis=0).min(axis=1), 1)
    kept = first < last
    return np.stack([(start + share[:, None] * way)[kept] for share in (first, last)], axis=1)


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
