"""Colours, dashes and text sizes: one style for all pictures, suitable for colour-blind readers."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

# Okabe and Ito, 2008.
BLACK, ORANGE, SKY, GREEN = "#000000", "#E69F00", "#56B4E9", "#009E73"
YELLOW, BLUE, VERMILLION, PURPLE = "#F0E442", "#0072B2", "#D55E00", "#CC79A7"
GREY = "#8C8C8C"

#: Targets are grey. Each loss has the same colour in the whole book.
TARGET = GREY
LOSS_COLOURS = {"Chamfer": VERMILLION, "sliced Wasserstein": BLUE, "exact Wasserstein": GREEN, "Sinkhorn": PURPLE}
LOSS_COLOURS |= {"windows": ORANGE, "sliced partial": SKY, "sliced unbalanced": "#7A5C00", "kernel norm": "#882255"}
#: Each loss also has the same dashes, for print and where colours cannot be distinguished.
LOSS_DASHES = {"Chamfer": "-", "sliced Wasserstein": "--", "exact Wasserstein": "-.", "Sinkhorn": ":"}
LOSS_DASHES |= {"windows": (0, (8, 2)), "sliced partial": (0, (4, 1, 1, 1)), "sliced unbalanced": (0, (2, 2))}
LOSS_DASHES |= {"kernel norm": (0, (1, 1))}

#: In inches. At this width 12 point text is readable when a picture is shown on a screen of 400 pixels.
WIDTH = 6.4

#: A system has the colour of the loss that trains it.
SYSTEM_COLOURS = {"DDOT": BLUE, "CortexODE": VERMILLION, "windows": ORANGE, "CorticalFlow++": PURPLE, "Vox2Cortex": SKY}
SYSTEM_COLOURS |= {"DeepCSR": GREEN, "CFPP": PURPLE}


def use_style(text_points: float = 12.0) -> None:
    """Set matplotlib's defaults for the pictures of the book.

    Parameters
    ----------
    text_points : float
        Size of titles, labels and ticks. Legends are one point smaller.

    Raises
    ------
    ValueError
        If the size is not a number above one.
    """
    if not 1 < text_points < np.inf:
        raise ValueError(f"text_points is {text_points!r}; a size in points above 1 is needed, such as 12")
    plt.rcParams.update(
        {
            "figure.dpi": 110,
            "figure.facecolor": "white",
            "savefig.facecolor": "white",
            "font.size": text_points,
            "axes.titlesize": text_points,
            "axes.spines.top": False,
            "axes.spines.right": False,
            "axes.prop_cycle": plt.cycler(color=[ORANGE, SKY, PURPLE, GREEN, BLACK]),
            "legend.frameon": False,
            "legend.fontsize": text_points - 1,
            "image.cmap": "viridis",
            "lines.linewidth": 2,
        }
    )


def loss_line(name: str) -> dict:
    """Colour and dashes of a loss, as keyword arguments for a line. Black and solid for an unknown name."""
    return {"color": LOSS_COLOURS.get(name, BLACK), "linestyle": LOSS_DASHES.get(name, "-")}


def legend_above(figure: Figure, ax: Axes) -> None:
    """Place one legend with two columns above all panels, from the names in one panel, which are the same in all."""
    handles, names = ax.get_legend_handles_labels()
    figure.legend(handles, names, loc="outside upper center", ncols=2)
