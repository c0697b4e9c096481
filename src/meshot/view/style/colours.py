"""One look for all pictures: colours that colour-blind readers tell apart, type that survives a narrow screen."""

import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

# Okabe and Ito, 2008.
BLACK, ORANGE, SKY, GREEN = "#000000", "#E69F00", "#56B4E9", "#009E73"
YELLOW, BLUE, VERMILLION, PURPLE = "#F0E442", "#0072B2", "#D55E00", "#CC79A7"
GREY = "#8C8C8C"

#: What is aimed at is grey; each loss keeps its colour through the whole book.
TARGET = GREY
LOSS_COLOURS = {
    "Chamfer": VERMILLION,
    "sliced Wasserstein": BLUE,
    "exact Wasserstein": GREEN,
    "Sinkhorn": PURPLE,
}
#: For lines in print and where colours fail: each loss keeps its dashes too.
LOSS_DASHES = {"Chamfer": "-", "sliced Wasserstein": "--", "exact Wasserstein": "-.", "Sinkhorn": ":"}

#: Inches; at this width 12 point type is still readable when a picture shrinks to a screen of 400 pixels.
WIDTH = 6.4


def use_style() -> None:
    """Set matplotlib's defaults for the pictures of the book."""
    plt.rcParams.update(
        {
            "figure.dpi": 110,
            "figure.facecolor": "white",
            "savefig.facecolor": "white",
            "font.size": 12,
            "axes.titlesize": 12,
            "axes.spines.top": False,
            "axes.spines.right": False,
            "axes.prop_cycle": plt.cycler(color=[ORANGE, SKY, PURPLE, GREEN, BLACK]),
            "legend.frameon": False,
            "legend.fontsize": 11,
            "image.cmap": "viridis",
            "lines.linewidth": 2,
        }
    )


def loss_line(name: str) -> dict:
    """Colour and dashes of a loss, as keyword arguments for a line; black and solid for an unknown name."""
    return {"color": LOSS_COLOURS.get(name, BLACK), "linestyle": LOSS_DASHES.get(name, "-")}


def legend_above(figure: Figure, ax: Axes) -> None:
    """Set the names of one panel, which are those of every panel, above all of them in two columns."""
    handles, names = ax.get_legend_handles_labels()
    figure.legend(handles, names, loc="outside upper center", ncols=2)
