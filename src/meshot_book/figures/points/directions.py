"""Directions in space as lines through a half sphere, seen from above."""

from collections.abc import Mapping

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from meshot.types import Array, Float, Tensor
from meshot.view import BLUE, GREY, WIDTH


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
