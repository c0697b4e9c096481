"""The deformation network as a drawing: what goes in, what each layer makes of it, and how many numbers it learns."""

import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from meshot.model import DeformationNetwork
from meshot.view import BLUE, GREEN, ORANGE, WIDTH

_Box = tuple[str, str, int]  # what it is, the shape of what comes out, how many numbers it learns


def network_boxes(network: DeformationNetwork) -> dict[str, list[_Box]]:
    """The layers by the branch they are in, each with the shape that leaves it and the numbers it learns."""

    def learned(layer: object) -> int:
        return sum(parameter.numel() for parameter in layer.parameters())

    form = network.config()
    width, size, n_scales = form["width"], form["size"], form["n_scales"]
    cubes = f"{n_scales} × {size}³" if n_scales > 1 else f"{size}³"
    joined = [("side by side", str(2 * width), 0)]
    joined += [("linear", str(layer.out_features), learned(layer)) for layer in network.perceptron]
    return {
        "position": [("place x (mm)", "3", 0), ("linear", str(width), learned(network.of_position))],
        "image": [
            ("cubes around x", cubes, 0),
            ("3D convolution", str(width), learned(network.cubes)),
            ("linear", str(width), learned(network.of_image)),
        ],
        "joined": [*joined, ("linear", "3", learned(network.to_velocity)), ("velocity (mm)", "3", 0)],
    }


def network_figure(network: DeformationNetwork) -> Figure:
    """Two branches, image on the left and position on the right, that meet in the perceptron between them.

    Parameters
    ----------
    network : DeformationNetwork
        Every box says what it is, the shape that leaves it, and how many numbers it learns, if any.
    """
    boxes = network_boxes(network)
    n_rows = len(boxes["joined"]) + 0.6
    figure, ax = plt.subplots(figsize=(WIDTH, 1.06 * n_rows + 0.4), layout="constrained")
    ax.set(xlim=(0, 10), ylim=(-n_rows, 0.4))
    ax.set_axis_off()
    ends = {}
    for name, x, colour in (("image", 0.1, BLUE), ("joined", 3.5, GREEN), ("position", 6.9, ORANGE)):
        ax.text(x + 1.5, 0.1, {"joined": "both"}.get(name, name), ha="center", fontweight="bold")
        for row, box in enumerate(boxes[name]):
            _draw_box(ax, x, -1.0 - row, box, colour)
            if row:
                _draw_arrow(ax, (x + 1.5, -row), (x + 1.5, -0.2 - row))
        ends[name] = -0.6 - (len(boxes[name]) - 1)
    _draw_arrow(ax, (3.1, ends["image"]), (3.48, -0.6))
    _draw_arrow(ax, (6.9, ends["position"]), (6.52, -0.6))
    ax.text(0.1, -n_rows + 0.1, f"learned in all: {network.n_parameters:,}".replace(",", " "))
    return figure


def _draw_box(ax: Axes, x: float, y: float, box: _Box, colour: str) -> None:
    what, shape, learned = box
    style = {"boxstyle": "round,pad=0.02", "linewidth": 2, "edgecolor": colour, "facecolor": "white"}
    ax.add_patch(FancyBboxPatch((x, y), 3.0, 0.8, **style))
    lines = [what, f"→ {shape}"] + [f"learns {learned:,}".replace(",", " ")] * bool(learned)
    for k, line in enumerate(lines):
        ax.text(x + 1.5, y + 0.4 + 0.25 * ((len(lines) - 1) / 2 - k), line, ha="center", va="center")


def _draw_arrow(ax: Axes, start: tuple[float, float], end: tuple[float, float]) -> None:
    arrow = {"arrowstyle": "-|>", "color": "0.3", "linewidth": 1.4, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", end, start, arrowprops=arrow)
