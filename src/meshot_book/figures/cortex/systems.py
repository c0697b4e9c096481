"""How a system works, as one drawing: rows of boxes from the scan to a surface, with the number of learned weights."""

import dataclasses
from collections.abc import Callable, Sequence
from typing import Literal

import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch
from torch import nn

from meshot.model import DeformationNetwork
from meshot.settings import Settings
from meshot.systems import get_system
from meshot.view import BLUE, GREEN, GREY, ORANGE, WIDTH

#: The look of each kind of step: its border, its dashes, and the width of its border.
_LOOKS = {"data": (GREY, "-", 1.2), "learned": (BLUE, "-", 3.5), "fixed": (ORANGE, "--", 1.8)}
_ROW, _BOX, _LEGEND = 1.0, 0.76, 0.75  # inches


@dataclasses.dataclass(frozen=True)
class SystemStep:
    """One box of the drawing.

    Parameters
    ----------
    kind : str
        "data", "learned" or "fixed".
    lines : tuple of str
        What the box says, at most three lines.
    n_weights : int
        Number of learned weights. Zero if nothing is learned.

    Raises
    ------
    ValueError
        If the kind is unknown, or a step that is not learned has weights.
    """

    kind: Literal["data", "learned", "fixed"]
    lines: tuple[str, ...]
    n_weights: int = 0

    def __post_init__(self):
        if self.kind not in _LOOKS:
            raise ValueError(f"kind is {self.kind!r}; one of {', '.join(_LOOKS)} is needed")
        if (self.n_weights > 0) != (self.kind == "learned"):
            raise ValueError(f"a step of kind {self.kind} has {self.n_weights} weights; only learned steps have some")

    @property
    def text(self) -> str:
        """The lines of the box. The last one states the weights, if there are any."""
        number = f"{self.n_weights:,} weight{'s' * (self.n_weights > 1)}".replace(",", " ")
        return "\n".join([*self.lines, *[f"learns {number}"] * bool(self.n_weights)])


def system_figure(rows: Sequence[Sequence[SystemStep]]) -> Figure:
    """Rows of one or two boxes, from top to bottom. Every box of a row leads to every box of the next row.

    The kinds differ in the line of their border, and a legend says which is which.

    Raises
    ------
    ValueError
        If a row has no box or more than two.
    """
    wrong = [len(row) for row in rows if len(row) not in (1, 2)]
    if wrong or not rows:
        raise ValueError(f"{len(rows)} rows came, with {wrong} boxes in some; rows of one or two boxes are needed")
    height = _ROW * len(rows) + _LEGEND
    figure, ax = plt.subplots(figsize=(WIDTH, height), layout="constrained")
    ax.set(xlim=(0, WIDTH), ylim=(0, height))
    ax.set_axis_off()
    above: list[float] = []
    for number, row in enumerate(rows):
        top = height - _ROW * number - 0.05
        middles = [WIDTH * (2 * k + 1) / (2 * len(row)) for k in range(len(row))]
        for step, middle in zip(row, middles):
            width = WIDTH / len(row) - 0.3
            colour, dashes, line = _LOOKS[step.kind]
            look = {"boxstyle": "round,pad=0", "edgecolor": colour, "facecolor": "white", "linestyle": dashes}
            ax.add_patch(FancyBboxPatch((middle - width / 2, top - _BOX), width, _BOX, linewidth=line, **look))
            ax.text(middle, top - _BOX / 2, step.text, ha="center", va="center", linespacing=1.05)
            for start in above:
                _draw_arrow(ax, (start, top + _ROW - _BOX), (middle, top), len(above) > len(row))
        above = middles
    _draw_legend(ax)
    return figure


def _draw_arrow(ax: Axes, start: tuple[float, float], end: tuple[float, float], meeting: bool) -> None:
    """An arrow from the bottom of a box to the top of another; arrows that meet end a little apart."""
    x = end[0] + (0.12 * (start[0] - end[0]) if meeting else 0.0)
    arrow = {"arrowstyle": "-|>", "color": "0.3", "linewidth": 1.4, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", (x, end[1]), start, arrowprops=arrow)


def _draw_legend(ax: Axes) -> None:
    for k, (kind, (colour, dashes, line)) in enumerate(_LOOKS.items()):
        x = WIDTH * k / len(_LOOKS) + 0.15
        ax.plot([x, x + 0.45], [0.25, 0.25], color=colour, linestyle=dashes, linewidth=line)
        ax.text(x + 0.55, 0.25, kind, va="center")


# What each system does, as rows of steps for a drawing. Numbers come from its settings and from its networks.

_Rows = list[list[SystemStep]]


def count_weights(*modules: nn.Module) -> int:
    """The number of learned weights of modules together."""
    return sum(parameter.numel() for module in modules for parameter in module.parameters())


def system_steps(name: str, settings: Settings) -> _Rows:
    """The steps of a system with some settings, from the scan to a surface.

    Parameters
    ----------
    name : str
        One of "classical", "deepcsr", "vox2cortex", "corticalflow", "cortexode" and "ddot".
    settings : Settings
        See :func:`meshot.systems.read_settings`.

    Raises
    ------
    ValueError
        If there is no drawing of that system.
    """
    if name not in _DRAWN:
        raise ValueError(f"there is no drawing of {name!r}; name one of {', '.join(_DRAWN)}")
    return _DRAWN[name](settings)


def _data(*lines: str) -> SystemStep:
    return SystemStep("data", lines)


def _fixed(*lines: str) -> SystemStep:
    return SystemStep("fixed", lines)


def _learned(n_weights: int, *lines: str) -> SystemStep:
    return SystemStep("learned", lines, n_weights)


def _classical(settings: Settings) -> _Rows:
    surface = settings.surface
    return [
        [_data("scan"), _data("mean white matter of", "the training subjects")],
        [_fixed("bias correction: the scan relative to", "the brightness of deep white matter")],
        [_learned(1, "threshold")],
        [_fixed("largest component, filled cavities,", "genus 0, marching cubes")],
        [_fixed(f"{surface.rounds} moves to the steepest edge, up to", f"{surface.reach} mm away, and smoothing")],
        [_data("surface")],
    ]


def _deepcsr(settings: Settings) -> _Rows:
    network = get_system("deepcsr").new_networks(settings)["distances"]
    encoder = count_weights(network.encoder, network.of_whole)
    n_maps = len(network.encoder.widths)
    n_blocks = settings.network.n_blocks
    return [
        [_data("scan"), _data("a position x, in mm")],
        [_learned(encoder, f"encoder: maps of {n_maps} resolutions,", "and one vector for the whole scan")],
        [_fixed("features at x, by interpolation in every map")],
        [
            _learned(
                count_weights(network) - encoder, f"decoder: {n_blocks} residual blocks that", "read x and its features"
            )
        ],
        [_data("signed distances of x from the surfaces")],
        [_fixed("all x of a grid: smoothing, largest", "component, genus 0, marching cubes")],
        [_data("surface")],
        [_fixed("in training only: absolute error of the", "distances of random points")],
    ]


def _vox2cortex(settings: Settings) -> _Rows:
    network = get_system("vox2cortex").new_networks(settings)["meshes"]
    image = count_weights(network.unet, network.to_classes)
    return [
        [_data("scan"), _data("templates, left and right" if len(network.kinds) == 1 else "white and pial templates")],
        [_learned(image, "residual U-Net: maps of all levels,", "and a segmentation (for the loss)")],
        [_fixed(f"{len(network.stages)} stages, coarse maps first:", "features of the maps at every vertex")],
        [_learned(count_weights(network) - image, "in each stage: graph networks", "move every vertex")],
        [_data("a surface after every stage")],
        [_fixed("in training only: Chamfer weighted by", "curvature, normals, evenness, at every stage")],
    ]


def _corticalflow(settings: Settings) -> _Rows:
    training = settings.training
    steps = f"flow: {training.method.upper()}, {training.n_flow_steps} steps"
    rows = [[_data("scan"), _data("template")]]
    for part, network in get_system("corticalflow").new_networks(settings).items():
        side, kind, number = part.split("_")
        if side == "right":
            continue
        k = int(number) - 1  # grids before this one, in its cascade
        if kind == "pial" and not k:
            rows.append([_data("white surface")])
        reads = "reads the scan" if not k else f"reads the scan and {k} velocity grid{'s' * (k > 1)}"
        rows.append([_learned(count_weights(network), f"U-Net {k + 1}: a velocity grid;", reads)])
        rows.append([_fixed(f"the vertices follow this grid ({steps})")])
    loss = _fixed("in training only, block by block: Chamfer", "between drawn points, and edge length")
    return [*rows, [_data("surface")], [loss]]


def _deformation(settings: Settings, loss: tuple[str, str]) -> _Rows:
    network, training = settings.new_network(), settings.training
    form = network.config()
    cubes = f"cubes of {form['size']}³ voxels at {form['n_scales']} scales"
    return [
        [_data("scan"), _data("initial surface,", "from the segmentation")],
        [_learned(count_weights(network), "velocity at x, from x and", cubes)],
        [_fixed(f"flow: {training.method.capitalize()}, {training.n_flow_steps} steps")],
        [_data("surface")],
        [_fixed(*loss)],
    ]


def _cortexode(settings: Settings) -> _Rows:
    return _deformation(settings, ("in training only: Chamfer between points", "drawn from both surfaces"))


def _ddot(settings: Settings) -> _Rows:
    n = settings.loss.loss.n_directions
    return _deformation(
        settings, (f"in training only: sliced Wasserstein, {n} directions,", "between centres and normals of all faces")
    )


_DRAWN: dict[str, Callable[[Settings], _Rows]] = {
    "classical": _classical,
    "deepcsr": _deepcsr,
    "vox2cortex": _vox2cortex,
    "corticalflow": _corticalflow,
    "cortexode": _cortexode,
    "ddot": _ddot,
}


# The deformation network as a drawing: what goes in, what each layer makes of it, and how many numbers it learns.

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
            y = -1.0 - row
            what, shape, learned = box
            style = {"boxstyle": "round,pad=0.02", "linewidth": 2, "edgecolor": colour, "facecolor": "white"}
            ax.add_patch(FancyBboxPatch((x, y), 3.0, 0.8, **style))
            lines = [what, f"→ {shape}"] + [f"learns {learned:,}".replace(",", " ")] * bool(learned)
            for k, line in enumerate(lines):
                ax.text(x + 1.5, y + 0.4 + 0.25 * ((len(lines) - 1) / 2 - k), line, ha="center", va="center")
            if row:
                _draw_link(ax, (x + 1.5, -row), (x + 1.5, -0.2 - row))
        ends[name] = -0.6 - (len(boxes[name]) - 1)
    _draw_link(ax, (3.1, ends["image"]), (3.48, -0.6))
    _draw_link(ax, (6.9, ends["position"]), (6.52, -0.6))
    ax.text(0.1, -n_rows + 0.1, f"learned in all: {network.n_parameters:,}".replace(",", " "))
    return figure


def _draw_link(ax: Axes, start: tuple[float, float], end: tuple[float, float]) -> None:
    arrow = {"arrowstyle": "-|>", "color": "0.3", "linewidth": 1.4, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", end, start, arrowprops=arrow)
