"""Motion that a reader can stop: a small page with a slider, whole in itself, that needs no network."""

import base64
import dataclasses
import html
import json
from collections.abc import Mapping, Sequence

import numpy as np

from meshot.mesh import Contour
from meshot.types import Float, Tensor
from meshot.view import filled, identity, still_of
from meshot.view.style import BLACK, LOSS_COLOURS
from meshot_book.figures.points.player_page import PAGE
from meshot_book.figures.points.points import box_around, process_figure

LEVELS = 65535


@dataclasses.dataclass(frozen=True, eq=False)
class Player:
    """A page that notebooks and the book show as it is.

    Parameters
    ----------
    page : str
        HTML, with style, script, data and a still picture inside.
    n_frames : int
    """

    page: str
    n_frames: int

    def _repr_html_(self) -> str:
        return self.page

    def __repr__(self) -> str:
        return f"Player({self.n_frames} frames; run the cell to see it move)"


def point_player(
    frames: Mapping[str, Float[Tensor, "k n 2"]], steps: Sequence[int], contour: Contour, description: str
) -> Player:
    """Points moving to a contour, a panel for every loss, with a slider, a button, and a still picture first.

    It starts at rest. Where a reader asks for reduced motion, frames change one by one instead of gliding. Without
    scripts the still picture stays.

    Parameters
    ----------
    frames : mapping
        Name of the loss → the points at each of ``steps``; positions are stored in 16 bits, far below a pixel.
    steps : sequence of int
        The moments, rising.
    contour : Contour
        The target, in grey.
    description : str
        What is to be seen, for those who do not see it.

    Raises
    ------
    ValueError
        If a loss does not have one frame for each step.
    """
    for name, points in frames.items():
        if len(points) != len(steps):
            raise ValueError(f"{name} has {len(points)} frames for {len(steps)} steps; one for each is needed")
    left, right, bottom, top = box_around(contour)
    corners = contour.vertices[contour.edges].detach().cpu().numpy().round(4).tolist()
    data = {
        "box": [left, right, bottom, top],
        "edges": corners,
        "steps": [int(step) for step in steps],
        "panels": [
            {
                "name": name,
                "colour": LOSS_COLOURS.get(name, BLACK),
                "points": _packed(points, (left, right, bottom, top)),
            }
            for name, points in frames.items()
        ],
    }
    text = json.dumps(data, separators=(",", ":"))
    still = {name: {int(steps[-1]): points[-1]} for name, points in frames.items()}
    values = {
        "@ID@": identity("player", text),
        "@LABEL@": html.escape(description, quote=True),
        "@STILL@": _picture(still, contour),
        "@LAST@": str(len(steps) - 1),
        "@DATA@": text.replace("<", "\\u003c"),
    }
    return Player(filled(PAGE, values), len(steps))


def _packed(points: Float[Tensor, "k n 2"], box: tuple[float, float, float, float]) -> str:
    """Positions in the box as little-endian 16-bit integers, base64."""
    low, size = np.array(box[::2]), np.array([box[1] - box[0], box[3] - box[2]])
    share = (points.detach().cpu().double().numpy() - low) / size
    return base64.b64encode(np.rint(share.clip(0, 1) * LEVELS).astype("<u2").tobytes()).decode()


def _picture(moments: Mapping[str, Mapping[int, Tensor]], contour: Contour) -> str:
    return still_of(process_figure(moments, contour))
